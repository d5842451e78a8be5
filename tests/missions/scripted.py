"""Analyses that follow a script of mission time, and a remote user, for the mission patterns."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import ClassVar

from typing_extensions import Self

from aerodaas import (
    AeroNavigation,
    Analytics,
    Detection,
    Detections,
    Frame,
    NavigableAnalytics,
    NavigationType,
    Odometry,
    VelocityCommand,
)
from aerodaas.analytics.base import Context
from aerodaas.clock import seconds
from aerodaas.environment.remote_client import RemoteClient
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.mission import RobotStatus

__all__ = ["Drift", "RemoteUser", "ScriptedDetector", "free_port"]


class Drift(NavigableAnalytics):
    """Asks for one velocity from `start` to `end`, and says nothing at other times."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry, Frame)

    def __init__(self, start: float, end: float, command: VelocityCommand) -> None:
        """Repeat `command` between these seconds of mission time."""
        self._between = start, end
        self._command = command

    def process(self, item: object, context: Context) -> AeroNavigation | None:  # noqa: ARG002
        """Return the command, or None outside its time."""
        start, end = self._between
        if not start <= seconds(context.now()) < end:
            return None
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [self._command])


class ScriptedDetector(Analytics[Detections]):
    """Stands in for a model: sees one box, in parts of the picture, from `start` to `end`."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections

    def __init__(
        self, label: str, start: float, end: float, box: tuple[float, float, float, float]
    ) -> None:
        """See `label` in `box` (left, top, right, bottom, 0 to 1) between these seconds."""
        self._label = label
        self._between = start, end
        self._box = box

    def process(self, item: Frame, context: Context) -> Detections:
        """Return what the script says for the frame's time."""
        start, end = self._between
        if not start <= seconds(context.now()) < end:
            return Detections.of(item, [])
        left, top, right, bottom = self._box
        width, height = item.width, item.height
        box = (left * width, top * height, right * width, bottom * height)
        return Detections.of(item, [Detection(box, self._label, 0.9)])


class RemoteUser:
    """A thread that plays a script against the remote control of a mission that is flying."""

    def __init__(self, port: int, script: Callable[[RemoteUser], None]) -> None:
        """Speak with the service at `port`."""
        self.client = RemoteClient(f"http://127.0.0.1:{port}")
        self.failure: BaseException | None = None
        self._script = script
        self._thread = threading.Thread(target=self._play, name="remote user", daemon=True)

    def __enter__(self) -> Self:
        """Start."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Wait for the script's end; raises what it raised."""
        self._thread.join(120)
        assert not self._thread.is_alive(), "the remote user still waits"
        if self.failure is not None:
            raise self.failure

    def until(self, happened: Callable[[RobotStatus], bool]) -> RobotStatus:
        """Watch the status until `happened`; returns it."""
        return next(status for status in self._statuses() if happened(status))

    def _statuses(self) -> Iterator[RobotStatus]:
        given_up = time.monotonic() + 120
        while time.monotonic() < given_up:
            try:
                yield self.client.status()
            except AeroDaaSError:  # not there yet
                time.sleep(0.05)
            time.sleep(0.01)

    def _play(self) -> None:
        try:
            self._script(self)
        except BaseException as error:  # noqa: BLE001 - handed to the test
            self.failure = error


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])
