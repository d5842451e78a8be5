"""The process of one flight: `python -m aerodaas.flights FOLDER`.

It holds all that the flight needs: the document, the limited environment and the end of the lease.
The service starts it and talks to it, but neither its end nor the database's ends the flight.
"""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

from aerodaas.analytics.here.analysis import HereSite
from aerodaas.analytics.here.relay import HereRelay, attach_absent_user
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions, current_options
from aerodaas.dataflow.graph import Graph
from aerodaas.dataflow.mission_document import MissionDocument, read_mission
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.environment import Environment
from aerodaas.environment.run import Run
from aerodaas.errors import AeroDaaSError, MissionError
from aerodaas.mission.commands import Answer, Command, ReturnHome
from aerodaas.runtime.reports import FlightState
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.flights.folder import FlightFolder, RobotLocks
from aerodaas.service.flights.orders import FlightOrder, Outcome
from aerodaas.service.flights.server import LeasedFlight, LeaseWatch, ProcessServer

__all__ = ["FlightProcess", "fly"]

_USER_SECONDS = 30.0
"""Wall seconds for the user's side to connect before take-off."""
_NICENESS = 10
"""Of an attached mission and all that it starts: the flight has the processor first."""
_LOOK_SECONDS = 0.1
"""Wall seconds between two looks at whether the user has connected."""


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
        folder.end(FlightProcess(folder, order).outcome())


class FlightProcess:
    """One flight from its order to its outcome."""

    def __init__(self, folder: FlightFolder, order: FlightOrder) -> None:
        self._folder = folder
        self._order = order
        self._began = time.time()
        self._lease = LeaseWatch(order, self._come_home, lambda: folder.cancelled)
        self._relay = HereRelay(folder.path / "here")
        self._run: Run | None = None
        self._environment: Environment | None = None
        self._called: set[str] = set()
        """Drones that have been called home and have answered."""
        self.served = LeasedFlight(self, order.mission, self._lease)
        """The flight behind the API."""

    def outcome(self) -> Outcome:
        """Fly, and tell how it ended; a failure is an outcome, too."""
        reason = ""
        try:
            self._fly()
        except AeroDaaSError as error:
            reason = str(error)
        except (KeyboardInterrupt, SystemExit) as error:
            reason = getattr(error, "reason", "") or "the flight's process was asked to end"
        run, meter = self._run, self.served.meter
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
            status=meter.status,
            places=meter.places,
            alerts=meter.alerts,
            **meter.usage({} if run is None else run.reports()),
        )

    def _fly(self) -> None:
        order, document = self._order, read_mission(self._folder.document)
        simulated_time = order.speed == "max"
        config = environment_of(order)
        current_options.set(
            RunOptions(
                environment=order.fleet,
                config=config,
                speed=None if order.speed == "max" else order.speed,
                simulated_time=simulated_time,
                senses_only=order.attached is not None,
                seed=order.seed,
                record=self._folder.recording,
                address=order.address,
                locks=None if order.rehearsal else order.locks,
                edge=order.edge,
                view=False,
                remote=False,
                report=None if order.rehearsal or order.attached else "page",
            )
        )
        environment = self._environment = Environment(order.fleet)
        here = HereSite(self._relay.path, lossless=simulated_time)
        build_mission(document, environment, self._folder.models, here)
        with contextlib.ExitStack() as ending:
            ending.callback(self._relay.close)
            # The sockets are there from the first moment on: a launch takes seconds.
            self._relay.start()
            if not order.rehearsal:
                server = ProcessServer(self._folder.socket, self.served, self._lease, self._relay)
                ending.callback(server.close)
                server.show()
            ending.callback(self.served.end)
            ending.callback(self._lease.stop)
            if not order.rehearsal:
                self._lease.start()
            self._await_user(document)
            if self._lease.reason:
                return
            self._run = environment.launch()
            self._run.wait()

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

    @property
    def config(self) -> EnvironmentConfig:
        """Environment of the flight; raises MissionError before it has begun."""
        return self._built.config

    @property
    def graph(self) -> Graph:
        """The mission's graph, once it is built."""
        return self._built.graph

    @property
    def _built(self) -> Environment:
        if self._environment is None:
            raise MissionError("the flight has not begun")
        return self._environment

    @property
    def state(self) -> FlightState | None:
        """State of the last poll."""
        return None if self._run is None else self._run.state

    def poll(self, newest: int = 200) -> FlightState:
        """Poll the drones, and bring them home once their lease has ended."""
        if self._run is None:
            raise MissionError("the flight has not begun")
        state = self._run.poll(newest)
        if self._lease.reason:
            self._come_home(self._lease.reason)
        if self._order.rehearsal and self.served.meter.time > 60.0 * self._order.minutes:
            self._lease.end("the lease has ended")
        return state

    def _come_home(self, reason: str) -> None:
        """Call every drone home, once; one that does not answer is called again by `look`."""
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

    def publish_alert(self, kind: str, text: str) -> None:
        """Do nothing: the service has recorded who gave a command."""

    @property
    def over(self) -> bool:
        """Whether the flight is over."""
        return self._run is not None and self._run.over
