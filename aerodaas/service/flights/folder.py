"""A flight on this machine: its folder, the locks of its drones, and the start of its process."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Collection, Iterator
from pathlib import Path

from pydantic import ValidationError

from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.errors import MissionError
from aerodaas.files.file_lock import actor_lock, exclusive, is_locked
from aerodaas.files.private_file import write_private
from aerodaas.service.flights.orders import FlightOrder, Outcome

__all__ = [
    "FlightFolder",
    "RobotLocks",
    "end_with_starter",
    "service_free_environment",
    "start_process",
]


class RobotLocks:
    """One lock for each drone of a provider: the process that flies a drone holds its lock."""

    def __init__(self, folder: Path) -> None:
        """Keep them in `folder`, which need not exist."""
        self._folder = folder

    @contextlib.contextmanager
    def hold(self, robots: Collection[str]) -> Iterator[None]:
        """Hold the locks of `robots`; raises MissionError for one that another process holds."""
        self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with contextlib.ExitStack() as held:
            for robot in robots:
                refusal = (
                    f"another process still flies {robot}: submit the mission again once that "
                    "flight is over"
                )
                held.enter_context(exclusive(self._folder / robot, refusal))
                if is_locked(actor_lock(self._folder, robot)):
                    raise MissionError(refusal)
            yield

    def held(self, robots: Collection[str]) -> set[str]:
        """Robots among `robots` whose lock a living process holds."""
        return {
            robot
            for robot in robots
            if is_locked(self._folder / robot) or is_locked(actor_lock(self._folder, robot))
        }


class FlightFolder:
    """One flight's folder; its content is the truth of a flight, whatever a database says."""

    def __init__(self, path: Path) -> None:
        """Name a folder, which need not exist."""
        self.path = path.absolute()
        self.order = self.path / "order.json"
        self.document = self.path / "mission.json"
        self.models = self.path / "models"
        self.recording = self.path / "flight.mcap"
        self.picture = self.path / "rehearsal.png"
        self.log = self.path / "log"
        self.socket = self.path / "api"
        """Unix socket at which the flight's process serves the API."""
        self._begun = self.path / "begun"
        self._lock = self.path / "lock"
        self._cancelled = self.path / "cancelled"
        self._outcome = self.path / "outcome.json"

    def make(self, order: FlightOrder, document: str) -> None:
        """Create the folder, for this user alone.

        Args:
            order: The flight's order.
            document: Text of the mission document.
        """
        self.models.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_private(self.document, document)
        write_private(self.order, order.model_dump_json(indent=2))

    @property
    def begun(self) -> bool:
        """Whether a process has ever begun this flight."""
        return self._begun.exists()

    @contextlib.contextmanager
    def claim(self) -> Iterator[None]:
        """Begin the flight, once and for all; hold its lock until the flight is over.

        Raises MissionError if it has been begun before, by this or any other process.
        """
        text = f"the flight in {self.path} has been begun before"
        # The lock first: a flight that has begun and holds no lock was killed.
        with exclusive(self._lock, text):
            try:
                self._begun.touch(exist_ok=False, mode=0o600)
            except FileExistsError:
                raise MissionError(text) from None
            yield

    @property
    def flying(self) -> bool:
        """Whether a living process holds the flight's lock; a killed one holds none."""
        return is_locked(self._lock)

    def cancel(self, reason: str) -> None:
        """Keep a cancellation for the flight's process, which may not listen yet."""
        write_private(self._cancelled, reason)

    @property
    def cancelled(self) -> str:
        """Why the flight is cancelled; empty if it is not."""
        try:
            return self._cancelled.read_text(encoding="utf-8")
        except OSError:
            return ""

    def end(self, outcome: Outcome) -> None:
        """Write how the flight ended."""
        write_private(self._outcome, outcome.model_dump_json(indent=2))

    def outcome(self) -> Outcome | None:
        """How the flight ended; None before, or where its process was killed."""
        try:
            return Outcome.model_validate_json(self._outcome.read_bytes())
        except (OSError, ValidationError):
            return None


_KEPT_OUT = "AERODAAS_"
"""Variables of the service itself, which hold its tokens."""


def service_free_environment(*, vehicles: bool) -> dict[str, str]:
    """The environment's variables without the service's own.

    Those of `vehicles` stay for a process that is connected with them.
    """
    kept = {MAVLINK_KEY} if vehicles else set()
    return {
        name: value
        for name, value in os.environ.items()
        if name in kept or not name.startswith(_KEPT_OUT)
    }


def start_process(folder: FlightFolder, *, tied: bool, vehicles: bool) -> subprocess.Popen[bytes]:
    """Start the process of the order in `folder`, in a session of its own.

    A flight goes on when the service ends, and Ctrl-C at the service's terminal does not reach it.

    Args:
        folder: The folder of the flight or rehearsal.
        tied: Whether it ends with the service, whatever ends that (see `tie`), as a rehearsal does.
        vehicles: Whether it connects with vehicles, and gets their secrets.
    """
    with folder.log.open("ab") as log:
        return subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-m", "aerodaas.flights", str(folder.path)],
            stdin=subprocess.PIPE if tied else subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            env=service_free_environment(vehicles=vehicles),
        )


def end_with_starter() -> None:
    """End this process, and all of its group, once the process that started it is gone.

    Its standard input must be a pipe whose other end its starter alone holds, and leaves alone:
    the system closes that end however the starter ends, also by SIGKILL. (Linux' signal at a
    parent's death goes by the thread that started a process, and reaches no grandchildren.)
    """
    threading.Thread(target=_await_end, name="tie", daemon=True).start()


def _await_end() -> None:
    os.read(0, 1)
    os.killpg(os.getpgrp(), signal.SIGKILL)
