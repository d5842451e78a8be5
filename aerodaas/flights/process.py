"""The process of one flight: `python -m aerodaas.flights FOLDER`.

It holds all that the flight needs: the document, the limited environment and the end of the lease.
The service starts it and talks to it, but neither its end nor the database's ends the flight.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from functools import cached_property
from pathlib import Path

from aerodaas.analytics.here.analysis import HereSite
from aerodaas.analytics.here.relay import HereRelay
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import EdgeShare, RunOptions, current_options
from aerodaas.dataflow.mission_document import MissionDocument, read_mission
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.environment import Environment
from aerodaas.environment.run import Run
from aerodaas.errors import AeroDaaSError, ConfigError, MissionError
from aerodaas.mission.commands import Answer, Command, ReturnHome
from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.schemas import AnalyticsOut, PictureForm, StatusOut, StreamKind
from aerodaas.service.flights.absent_user import attach_absent_user
from aerodaas.service.flights.control import ControlServer
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.locks import RobotLocks
from aerodaas.service.flights.order import FlightOrder, Outcome
from aerodaas.service.flights.watch import LeaseWatch
from aerodaas.service.live.meter import FlightMeter
from aerodaas.service.live.packed_reader import PackedReader, drawn_streams, ground_of
from aerodaas.terrain.ground import Ground

__all__ = ["Flying", "fly"]

_USER_SECONDS = 30.0
"""Wall seconds for the user's side to connect before take-off."""
_NICENESS = 10
"""Of an attached mission and all that it starts: the flight has the processor first."""
_LOOK_SECONDS = 0.1
"""Wall seconds between two looks at the drones."""


def fly(path: Path) -> None:
    """Fly the order in the folder `path`; returns when it is over and its outcome is written.

    Raises MissionError if this flight has been begun before, or another process flies a drone of
    its order.
    """
    folder = FlightFolder(path)
    order = FlightOrder.read(folder.order)
    os.chdir(folder.path)
    if order.attached is not None:
        os.nice(_NICENESS)
    with RobotLocks(order.locks).hold(order.robots), folder.claim():
        folder.end(Flying(folder, order).outcome())


class Flying:
    """One flight from its order to its outcome."""

    def __init__(self, folder: FlightFolder, order: FlightOrder) -> None:
        self._folder = folder
        self._order = order
        self._began = time.time()
        self._lease = LeaseWatch(order, self._come_home, lambda: folder.cancelled)
        self._relay = HereRelay(folder.path / "here")
        self._run: Run | None = None
        self.config: EnvironmentConfig | None = None
        """What is flown in; None before the limits have been found to leave room for the flight."""
        self._environment: Environment | None = None
        self._meter = FlightMeter()
        self._called: set[str] = set()
        """Drones that have been called home and have answered."""

    def outcome(self) -> Outcome:
        """Fly, and tell how it ended; a failure is an outcome, too."""
        reason = ""
        try:
            self._fly()
        except AeroDaaSError as error:
            reason = str(error)
        except (KeyboardInterrupt, SystemExit) as error:
            reason = getattr(error, "reason", "") or "the flight's process was asked to end"
        run = self._run
        if run is not None and run.state is not None:
            self._meter.note(run.state)
        ended = ""
        if self._order.attached is not None:
            ended = "the cameras are shared no more"
            # Also where the end came first: a camera that is withdrawn cannot be opened.
            reason = "" if self._lease.reason else reason
        return Outcome(
            landed=not reason,
            reason=reason or self._lease.reason or ended,
            began=self._began,
            ended=time.time(),
            status=self._meter.status,
            alerts=self._meter.alerts,
            **self._meter.usage({} if run is None else run.reports()),
        )

    def _fly(self) -> None:
        order, document = self._order, read_mission(self._folder.document)
        simulated_time = order.speed == "max"
        self.config = environment_of(order)
        current_options.set(
            RunOptions(
                environment=order.fleet,
                config=self.config,
                speed=None if order.speed == "max" else order.speed,
                simulated_time=simulated_time,
                senses_only=order.attached is not None,
                seed=order.seed,
                record=self._folder.recording,
                address=order.address,
                locks=None if order.rehearsal else order.locks,
                edge=None if order.edge is None else EdgeShare(**dict(order.edge)),
                view=False,
                remote=False,
                report=None if order.rehearsal or order.attached else "page",
            )
        )
        environment = self._environment = Environment(order.fleet)
        here = HereSite(self._relay.path, lossless=simulated_time)
        build_mission(document, environment, self._folder.models, here)
        server = ControlServer(self._folder, self, self._lease, self._relay)
        try:
            # The sockets answer from the first moment on: a launch takes seconds.
            self._relay.start()
            server.start()
            if not order.rehearsal:
                self._lease.start()
            self._await_user(document)
            if self._lease.reason:
                return
            self._run = environment.launch()
            threading.Thread(target=self._look, args=(self._run,), daemon=True).start()
            self._run.wait()
        finally:
            self._lease.stop()
            server.close()
            self._relay.close()

    def _await_user(self, document: MissionDocument) -> None:
        """Wait for the user's side, if the document needs it; a rehearsal goes without."""
        if self._order.rehearsal:
            attach_absent_user(self._relay)
            return
        until = time.monotonic() + _USER_SECONDS
        while document.here and not self._relay.wait_attached(_LOOK_SECONDS):
            if self._lease.reason:
                return
            if time.monotonic() > until:
                raise MissionError(
                    f"{', '.join(document.here)} run at the user's side, which did not connect "
                    f"within {_USER_SECONDS:g} s"
                )

    def _look(self, run: Run) -> None:
        """Keep the status up to date while the run goes on."""
        while not run.over:
            began = time.monotonic()
            # The thread that waits for the run meets the same error and handles it.
            with contextlib.suppress(AeroDaaSError):
                self._meter.note(run.look(0))
                if self._lease.reason:
                    self._come_home(self._lease.reason)
                if self._order.rehearsal and self._meter.time > 60.0 * self._order.minutes:
                    self._lease.end("the lease has ended")
            time.sleep(max(0.0, began + _LOOK_SECONDS - time.monotonic()))

    def _come_home(self, reason: str) -> None:
        """Call every drone home, once; one that does not answer is called again by `_look`."""
        run = self._run
        if run is None or run.over:
            return
        if self._order.attached is not None:
            run.end_sensing()
            return
        for robot in self._order.robots:
            if robot in self._called or not self._navigates(robot):
                continue
            # What one drone answers, or does not, keeps no other one in the air.
            with contextlib.suppress(AeroDaaSError):
                run.command(robot, ReturnHome(reason))
                self._called.add(robot)

    def _navigates(self, robot: str) -> bool:
        environment = self._environment
        edges = environment.graph.navigation if environment is not None else ()
        return robot in {edge.robot for edge in edges}

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command; raises MissionError for a robot that does not fly."""
        if self._run is None or not self._navigates(robot):
            raise MissionError(f"{robot} does not fly in this mission")
        return self._run.command(robot, command)

    def status(self) -> tuple[dict[str, StatusOut], list[str]]:
        """Newest status by robot, and the newest alerts."""
        return self._meter.status, self._meter.alerts

    def told(self) -> dict[str, float]:
        """Host time in seconds when that status came, by robot."""
        return self._meter.told

    def preflight(self) -> dict[str, PreflightOut]:
        """The list before take-off by robot."""
        return self._meter.preflight

    def analytics(self) -> AnalyticsOut | None:
        """What the analytics scheduler has done so far; None without one."""
        return self._meter.analytics

    @property
    def flown_seconds(self) -> float:
        """Mission time of the newest status, seconds."""
        return self._meter.time

    def streams(self) -> dict[str, StreamKind]:
        """The streams that can be drawn, by name, once they can be read."""
        environment = self._environment
        return {} if environment is None else drawn_streams(environment.graph)

    def reader(self, stream: str, form: PictureForm = PictureForm.WHOLE) -> PackedReader:
        """A reader of a stream, its pictures in a form; raises ConfigError if there is none."""
        graph = self._environment.graph if self._environment is not None else None
        if graph is None or stream not in graph.nodes or graph.reader is None:
            raise ConfigError(f"no stream of this mission is called {stream!r}")
        return PackedReader(graph.reader(stream), stream, form, self._ground)

    @cached_property
    def _ground(self) -> Ground | None:
        """What is flown over; it is read when something is watched."""
        return None if self.config is None else ground_of(self.config)

    @property
    def over(self) -> bool:
        """Whether the flight is over."""
        return self._run is not None and self._run.over
