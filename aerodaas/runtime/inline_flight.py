"""Flight of a plan in simulated time, in the application's own process."""

from __future__ import annotations

import copy
import logging
import os
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from aerodaas.config.options import LiveViews
from aerodaas.errors import AeroDaaSError, MissionError, failure_line
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import RobotStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vitals import read_vitals
from aerodaas.mission.commands import Answer, Command
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.recording.provenance import Provenance
from aerodaas.runtime.dispatch.simulated import SimulatedDispatcher
from aerodaas.runtime.inline import InlineExecutor
from aerodaas.runtime.live import LiveReader
from aerodaas.runtime.node import NEVER, Node
from aerodaas.runtime.nodes.analysis import AnalysisSpec
from aerodaas.runtime.nodes.controller import MakePlanner
from aerodaas.runtime.nodes.drone import DroneNode
from aerodaas.runtime.nodes.loop_calls import LoopCalls, LoopOverError
from aerodaas.runtime.nodes.recorder import RecorderNode
from aerodaas.runtime.plan import ActorPlan, CameraSpec, FlightPlan
from aerodaas.runtime.reports import ActorReport, FlightState
from aerodaas.runtime.session import Session

__all__ = ["InlineFlight"]

_ANSWER_TIMEOUT = 60.0
"""Wall seconds within which a call is served, between two moments."""
_STOP_TIMEOUT = 5.0
"""Wall seconds within which the step under way returns once the flight is stopped."""
_REPORT_INTERVAL = 0.02
"""Wall seconds between two reports of the drones."""
_VITALS_INTERVAL = 0.5
"""Wall seconds between two recorded readings of the process' vitals."""
_NOTES_KEPT = 50


class Proxies(Protocol):
    """Maker of proxies for nodes that run in processes of their own."""

    def camera(self, session: Session, camera: CameraSpec) -> Node | None:
        """Proxy of a camera; None if it runs in this process.

        Args:
            session: The flight's session.
            camera: The camera.
        """
        ...

    def analysis(self, session: Session, actor: ActorPlan, spec: AnalysisSpec) -> Node | None:
        """Proxy of an analysis of `actor`; None if it runs in this process.

        Args:
            session: The flight's session.
            actor: The actor of the plan that has the analysis.
            spec: The analysis.
        """
        ...


class InlineFlight:
    """The nodes of one run, stepped in a thread of this process."""

    headless = ""
    """Address of a lost head; empty, for no cluster is used."""
    flying = False
    """Whether a drone outlives the application: a simulated one ends with it."""
    reachable = True

    def __init__(
        self,
        plan: FlightPlan,
        recording: Path | None = None,
        provenance: Provenance | None = None,
        live: LiveViews | None = None,
        proxies: Proxies | None = None,
    ) -> None:
        """Create the nodes of `plan`.

        Args:
            plan: The run.
            recording: Path of the MCAP file; None for none.
            provenance: Versions, configuration and application, for the recording.
            live: Who looks on at what is recorded.
            proxies: Makes proxies of nodes that run in processes of their own; None for none.
        """
        self.plan = plan
        self._proxies = proxies
        self._executor = InlineExecutor()
        self._drone: DroneNode | None = None
        self._cameras: dict[str, Node] = {}
        self._analyses: dict[str, Node] = {}
        """By the stream of their results, in the order of the plan."""
        self._dispatcher: SimulatedDispatcher | None = None
        self._recorder: RecorderNode | None = None
        for actor in plan.actors:
            self._add(actor)
        if plan.dispatch is not None:
            scheduler = copy.deepcopy(plan.dispatch.scheduler)
            managed, resources = plan.dispatch.managed, plan.dispatch.resources
            self._dispatcher = SimulatedDispatcher(plan.session, scheduler, managed, resources)
            self._executor.add("dispatcher", [self._dispatcher])
        for name, specs in zip(plan.drone_actors, plan.drones, strict=True):
            self._drone = DroneNode(
                plan.session, name, specs, _planner_maker(), observed=plan.observed or {}
            )
            self._executor.add(name, [self._drone], first=True)
        if recording is not None and plan.recorded and provenance is not None:
            self._recorder = RecorderNode(plan.session, recording, plan.recorded, provenance, live)
            self._executor.add(plan.recorder_actor, [self._recorder])
        self._executor.order(self._nodes())
        self._calls = LoopCalls(lambda: None, self._publish_reports)
        self._thread = threading.Thread(target=self._run, name="flight", daemon=True)
        self._stopping = False
        self._sensed = False
        self._over = threading.Event()
        self._stopped = False
        self._robots: dict[str, RobotStatus] = {}
        self._notes: list[Alert] = []

    def _add(self, actor: ActorPlan) -> None:
        """Add the cameras and analyses of an actor as one part."""
        session, proxies = self.plan.session, self._proxies
        cameras: dict[str, Node] = {}
        for camera in actor.cameras:
            proxy = proxies.camera(session, camera) if proxies else None
            cameras[camera.stream] = proxy or camera.make(session)
        analyses: dict[str, Node] = {}
        # A flight works with copies, as actors do: the application's own objects stay as they are.
        memo: dict[int, object] = {}
        for spec in actor.analyses:
            proxy = proxies.analysis(session, actor, spec) if proxies else None
            own = replace(spec, work=copy.deepcopy(spec.work, memo))
            analyses[spec.stream] = proxy or own.make(session)
        self._cameras |= cameras
        self._analyses |= analyses
        self._executor.add(actor.name, [*cameras.values(), *analyses.values()])

    def _nodes(self) -> list[Node]:
        """All nodes in the order in which ready ones are stepped."""
        last = (self._dispatcher, self._drone, self._recorder)
        analyses = _by_dependence(self._analyses)
        return [*self._cameras.values(), *analyses, *(node for node in last if node is not None)]

    def launch(self, progress: Callable[[str], None] = lambda _: None) -> None:
        """Open everything and start flying; raises the errors of a node's opening.

        `progress` is called with the name of each part that is ready.
        """
        logging.captureWarnings(capture=True)
        self._handler = self._executor.log_handler()
        logging.getLogger("aerodaas").addHandler(self._handler)
        for part in tuple(self._executor.parts.values()):
            self._executor.open(part.nodes)
            progress(part.name)
        self._publish_reports()
        self._thread.start()

    def _run(self) -> None:
        try:
            self._fly()
        except Exception as error:  # noqa: BLE001 - the flight must end, and tell why
            for part in self._executor.parts.values():
                part.phase = "failed"
                part.error = part.error or AeroDaaSError(f"{part.name}: {failure_line(error)}")
        finally:
            self._calls.close("the mission is over")
            self._publish_reports()
            self._over.set()

    def _fly(self) -> None:
        executor = self._executor
        read_vitals()  # the first reading of a thread only begins the machine's measurement
        reported = recorded = time.monotonic()
        # Pure readers start first.
        executor.start(reversed(self._nodes()))
        while not self._stopping and not self._ended():
            self._calls.serve()
            now = executor.next_moment
            if now == NEVER:
                break
            executor.advance_to(now)
            clock = time.monotonic()
            if clock - reported >= _REPORT_INTERVAL:
                reported = clock
                self._publish_reports()
            if clock - recorded >= _VITALS_INTERVAL:
                recorded = clock
                self._record_vitals()
        self._calls.close("the mission is over")
        self._end_executions()
        self._record_vitals()

    def _end_executions(self) -> None:
        """Let the simulated executions of the last frames end, so that each has its outcome."""
        dispatcher = self._dispatcher
        if dispatcher is None:
            return
        self._executor.retire(node for node in self._nodes() if node is not self._recorder)
        while dispatcher.executing and dispatcher.due != NEVER:
            self._executor.step(dispatcher, dispatcher.due)

    def _ended(self) -> bool:
        if self._drone is not None:
            return self._executor.has_ended(self._drone) or self._drone.over
        return self._sensed or all(map(self._has_ended, self._cameras.values()))

    def _has_ended(self, camera: Node) -> bool:
        """Whether a camera has no more images, or has failed."""
        return self._executor.has_ended(camera) or any(camera.values().get("finished", {}).values())

    def _record_vitals(self) -> None:
        """Record the vitals of this process, which runs all nodes."""
        if self._recorder is not None:
            reading = {f"inline@{os.uname().nodename}": read_vitals()}
            self._recorder.write_vitals(reading, self._executor.clock.now())

    def _publish_reports(self) -> None:
        if self._drone is not None:
            self._robots = self._drone.reports()

    def poll(self, newest: int = 200) -> FlightState:
        """State of the run, with the `newest` latencies of each robot."""
        robots = {
            name: replace(report, latencies=self._drone.latencies(name, newest))
            for name, report in self._robots.items()
            if self._drone is not None
        }
        return FlightState(robots, self.reports(), self._over.is_set(), self.notes)

    @property
    def notes(self) -> tuple[Alert, ...]:
        """The newest alerts of the application."""
        return tuple(self._notes[-_NOTES_KEPT:])

    @property
    def recordings(self) -> tuple[Path, ...]:
        """File of the recording."""
        return () if self._recorder is None else (self._recorder.path,)

    def reports(self) -> dict[str, ActorReport]:
        """The report of each part."""
        return {name: part.report() for name, part in tuple(self._executor.parts.items())}

    def await_end(self, timeout: float) -> None:
        """Return once the flight is over, or after `timeout` seconds."""
        self._over.wait(timeout)

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command on a robot's mission, between two moments.

        Args:
            robot: Id of the robot.
            command: The command.

        Raises:
            MissionError: If the robot does not fly.
        """
        drone = self._drone
        if drone is None:
            raise MissionError(f"{robot} does not fly")
        try:
            return self._calls.ask(
                lambda: drone.command(robot, command, self._executor.clock.now()), _ANSWER_TIMEOUT
            )
        except LoopOverError as over:
            return Answer(accepted=False, text=f"{over}: {self._robots[robot].mission.state.value}")

    def publish_alert(self, kind: str, text: str) -> None:
        """Publish an alert of the application; in any thread.

        Args:
            kind: Kind of the alert.
            text: What it says.
        """
        header = Header(len(self._notes), self._executor.clock.now(), "application")
        self._notes.append(Alert(header, kind, text))
        if self._drone is not None:
            # By the drone's stream of alerts, which is recorded.
            self._executor.parts[self._drone.name].alert(kind, text)

    def end_sensing(self) -> None:
        """End a run without drones, which otherwise goes on as long as its cameras."""
        self._sensed = True

    def reader(self, stream: str, over: Callable[[], bool]) -> LiveReader | None:
        """A reader of `stream` for the application; None if no node publishes it.

        Args:
            stream: Name of the stream.
            over: Whether the flight is over.
        """
        if not self._executor.publishes(stream):
            return None
        return LiveReader(self._executor.tap(stream), over)

    def stop(self) -> dict[str, ActorReport]:
        """Stop the flight, close everything, and return the final reports."""
        if not self._stopped:
            self._stopped = self._stopping = True
            if self._thread.ident is not None:
                self._thread.join(_STOP_TIMEOUT)
            if self._thread.is_alive():
                self._leave_hung_step()
            else:
                self._executor.close()
            logging.getLogger("aerodaas").removeHandler(self._handler)
        return self.reports()

    def _leave_hung_step(self) -> None:
        """Say what has not returned, and close the recording without it."""
        part = self._executor.part_at_work
        names = ", ".join(node.name for node in part.nodes) if part is not None else "a node"
        self.publish_alert(
            "analysis_hung", f"{names} did not return within {_STOP_TIMEOUT:g} s: it is left"
        )
        if self._recorder is not None:
            self._recorder.close()

    def detach(self) -> None:
        """End with the application: a simulated drone does not outlive it."""
        self.stop()


def _planner_maker() -> MakePlanner:
    """A maker of planners that plan in the loop itself, with one copy of each scheduler."""
    memo: dict[int, object] = {}
    return lambda spec: InlinePlanner(copy.deepcopy(spec.scheduler, memo))


def _by_dependence(nodes: Mapping[str, Node]) -> list[Node]:
    """The analyses, by the stream of their results, each after those whose results it reads."""
    ordered: list[Node] = []

    def visit(stream: str, above: frozenset[str]) -> None:
        for source in nodes[stream].reads:
            if source in nodes and source not in above:
                visit(source, above | {source})
        if nodes[stream] not in ordered:
            ordered.append(nodes[stream])

    for stream in nodes:
        visit(stream, frozenset((stream,)))
    return ordered
