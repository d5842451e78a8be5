"""One's own flight as its console shows it: the one mission of a service that has no other."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

from aerodaas.console.meter import FlightMeter
from aerodaas.console.packed_reader import PackedReader, drawn_streams, ground_of
from aerodaas.errors import AeroDaaSError, ConfigError
from aerodaas.mission.commands import Answer, Command
from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.schemas import MissionOut, MissionPhase, PictureForm

if TYPE_CHECKING:
    from aerodaas.config.model import EnvironmentConfig
    from aerodaas.dataflow.graph import Graph
    from aerodaas.runtime.reports import FlightState
    from aerodaas.terrain.ground import Ground

__all__ = ["OWN", "Flown", "OwnFlight"]

OWN = "own"
"""Id of the mission, its tenant and its account: there is nobody else's."""
_LOOK_SECONDS = 0.1
"""Wall seconds between two looks at the drones while somebody watches."""
_WATCHED_SECONDS = 2.0
"""Wall seconds after which a flight that nobody asked for is not watched any more."""
_ITEM_SECONDS = 0.5


class Flown(Protocol):
    """The flight, called from several threads."""

    config: EnvironmentConfig
    graph: Graph
    state: FlightState | None
    """What a look has found last."""

    def look(self, newest: int = 200) -> FlightState:
        """Its present state; raises AeroDaaSError."""
        ...

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command on a robot's mission; raises AeroDaaSError."""
        ...

    def note(self, kind: str, text: str) -> None:
        """Publish an alert."""
        ...

    @property
    def over(self) -> bool:
        """Whether every mission has ended."""
        ...


class OwnFlight:
    """Newest state of the flight, its streams and its commands; safe in any thread."""

    def __init__(self, run: Flown, name: str) -> None:
        """Show `run`, an application called `name`."""
        self._run = run
        self._name = name
        self._meter = FlightMeter()
        self._lock = threading.Lock()
        self._began = time.time()
        self._version = 0
        self._text: tuple[int, str] = (-1, "")
        self._asked = 0.0
        self._closed = threading.Event()
        threading.Thread(target=self._look, name="console", daemon=True).start()

    def close(self) -> None:
        """Look no more; whoever watches is told that the flight is over."""
        if self._run.state is not None:
            self._take(self._run.state)
        self._closed.set()

    @property
    def over(self) -> bool:
        """Whether the flight is over."""
        return self._closed.is_set()

    @property
    def config(self) -> EnvironmentConfig:
        """What is flown in."""
        return self._run.config

    @cached_property
    def _ground(self) -> Ground | None:
        """What is flown over; it is read when something is watched."""
        return ground_of(self._run.config)

    def mission(self) -> MissionOut:
        """The flight as a service would show it."""
        self._asked = time.monotonic()
        states = {one.state for one in self._meter.status.values()}
        ended = MissionPhase.FAILED if "aborted" in states else MissionPhase.LANDED
        return MissionOut(
            id=OWN,
            name=self._name,
            tenant=OWN,
            account=OWN,
            phase=ended if self.over else MissionPhase.FLYING,
            robots=[robot.id for robot in self._run.config.robots],
            submitted=self._began,
            started=self._began,
            status=self._meter.status,
            told={} if self.over else self._meter.told,
            alerts=self._meter.alerts,
            analytics=self._meter.analytics,
            streams={} if self.over else drawn_streams(self._run.graph),
        )

    def preflight(self, robot: str) -> PreflightOut | None:
        """A robot's list before take-off; None if there is no such robot."""
        self._asked = time.monotonic()
        if robot not in {one.id for one in self._run.config.robots}:
            return None
        return self._meter.preflight.get(robot, PreflightOut(robot=robot))

    def version(self, mission: str) -> int:
        """A number that grows with each change; -1 once the flight is over."""
        del mission
        self._asked = time.monotonic()
        return -1 if self.over else self._version

    def text(self, mission: str) -> tuple[str, bool]:
        """The flight as JSON, made once for all that watch it, and whether it is over."""
        with self._lock:
            version = self.version(mission)
            if self._text[0] != version or version < 0:
                self._text = version, self.mission().model_dump_json()
            return self._text[1], version < 0

    def hear(self, mission: str) -> None:
        """Do nothing: the application, which is here, is the flight's user."""

    def items(
        self, mission: str, stream: str, form: PictureForm
    ) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Items of a stream; an empty one a while without any. Raises ConfigError if none is so."""
        del mission
        graph = self._run.graph
        if stream not in drawn_streams(graph) or graph.reader is None:
            raise ConfigError(f"no stream that can be drawn is called {stream!r}")
        reader = PackedReader(graph.reader(stream), stream, form, self._ground)
        while not self.over:
            yield reader.next_packed(_ITEM_SECONDS) or ({}, b"")

    def command(self, robot: str, command: Command, what: str) -> Answer:
        """Execute a command; raises AeroDaaSError.

        An alert tells of it and its answer, by `what` was asked; none where that is empty.
        """
        answer = self._run.command(robot, command)
        if not what:
            return answer
        word = "accepted" if answer.accepted else "refused"
        said = f"{word}{': ' if answer.text else ''}{answer.text}"
        self._run.note("console_command", f"the console asked {robot} to {what}: {said}")
        return answer

    def _look(self) -> None:
        while not self._closed.wait(_LOOK_SECONDS):
            if time.monotonic() - self._asked > _WATCHED_SECONDS or self._run.over:
                continue
            # The thread that waits for the run meets the same error and handles it.
            with contextlib.suppress(AeroDaaSError):
                self._take(self._run.look(0))

    def _take(self, state: FlightState) -> None:
        self._meter.note(state)
        self._version += 1
