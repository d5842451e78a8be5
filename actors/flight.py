"""A run as the application's process sees it: start all actors, watch them, stop them."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ray
from ray.exceptions import RayActorError, RayTaskError
from typing_extensions import Self

from aerodaas.actors._base import ActorInfo, ActorReport, StreamActor
from aerodaas.actors._ending import end_actors
from aerodaas.actors._lifeline import LIFE
from aerodaas.actors.analytics import AnalyticsActor
from aerodaas.actors.caretaker import Caretaker
from aerodaas.actors.cluster import Place, options_for, outlives_application
from aerodaas.actors.dispatcher import DispatcherActor, done_stream
from aerodaas.actors.drone import DroneActor, RobotReport
from aerodaas.actors.executor import CloudExecutor
from aerodaas.actors.plan import Dispatching, FlightPlan
from aerodaas.actors.recorder import RecorderActor
from aerodaas.actors.sensor import SensorActor
from aerodaas.clock import host_time_ns
from aerodaas.data import Alert
from aerodaas.errors import AeroDaaSError, MissionError
from aerodaas.navigation.commands import Answer, Command
from aerodaas.recording.provenance import Provenance

__all__ = ["Flight", "FlightState"]

_PREPARE_TIMEOUT = 90.0
_ANSWER_TIMEOUT = 5.0
_REPORT_INTERVAL = 0.5
_ANALYTICS_RESTARTS = 3


@dataclass(frozen=True)
class FlightState:
    """All of a run at one moment."""

    robots: dict[str, RobotReport]
    reports: dict[str, ActorReport]
    over: bool
    """True once every mission has ended."""

    @property
    def alerts(self) -> list[Alert]:
        """The newest alerts of all actors, oldest first."""
        alerts = [alert for report in self.reports.values() for alert in report.alerts]
        return sorted(alerts, key=lambda alert: alert.header.stamp)


@dataclass
class _Member:
    """One actor of the run."""

    name: str
    handle: Any
    setup: tuple[Any, ...]
    """What `prepare` is given."""
    info: ActorInfo | None = None
    report: ActorReport = field(default_factory=lambda: ActorReport("new"))
    pending: ray.ObjectRef[ActorReport] | None = None
    reviving: ray.ObjectRef[ActorInfo] | None = None
    """Under way after a restart."""


class Flight:
    """The actors of one run. Use as a context manager: leaving it stops them all."""

    def __init__(
        self,
        plan: FlightPlan,
        recording: Path | None = None,
        provenance: Provenance | None = None,
        live: str | None = None,
    ) -> None:
        """Create the actors of `plan`, all at once; `recording` is where the MCAP file goes.

        With `live`, `host:port`, what is recorded is served there, too.
        """
        self.plan = plan
        self.recording = recording if plan.recorded else None
        self._drones: dict[str, str] = {}
        self._members: dict[str, _Member] = {}
        self._helpers: list[Any] = []
        """Actors without streams, to be killed at the end."""
        self._detached = outlives_application()
        self._caretaker: Any = None
        self._opening: list[Any] = []
        session, edge = plan.session, Place()
        for specs in plan.drones:
            name = f"drone/{'+'.join(spec.robot.id for spec in specs)}"
            self._drones.update(dict.fromkeys((spec.robot.id for spec in specs), name))
            mine = {spec.robot.id for spec in specs}
            others = tuple(
                spec.robot.id
                for group in plan.drones
                for spec in group
                if spec.robot.id not in mine
            )
            self._create(name, DroneActor, edge, (session, name, specs, plan.conduct, others))
        for camera in plan.cameras:
            args = (session, camera.stream, camera.sensor, camera.state)
            self._create(f"sensor/{camera.stream}", SensorActor, edge, args, ends=camera.ends)
        for actor in plan.analyses:
            self._create(
                actor.name,
                AnalyticsActor,
                actor.place,
                (session, actor.name),
                setup=actor.nodes,
                restarts=_ANALYTICS_RESTARTS,
            )
        if plan.dispatch is not None:
            self._create_dispatcher(plan.dispatch)
        if self.recording is not None and provenance is not None:
            recorder = (session, self.recording, plan.recorded, provenance, live)
            self._create("recorder", RecorderActor, edge, recorder)
        if self._detached:
            self._appoint_caretaker()
        self._origin = 0
        self._next_reports = 0.0
        self._stopped = False

    def __enter__(self) -> Self:
        """Stop the actors when left."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the actors."""
        self.stop()

    def launch(self, progress: Callable[[str], None] = lambda _: None) -> None:
        """Open everything and start flying; raises what an actor could not open.

        `progress` is told what has become ready.
        """
        self._prepare(list(self._members.values()), progress)
        for reference in self._opening:
            ray.get(reference, timeout=_PREPARE_TIMEOUT)
        self._origin = host_time_ns()
        # Those that only listen go first, so that nobody speaks to an empty room.
        for member in reversed(self._members.values()):
            member.handle.start.remote(self._origin)
            member.report = ActorReport("running")

    def poll(self, newest: int = 200) -> FlightState:
        """Ask how everyone fares, with the `newest` latencies of each robot.

        Also tells the drones that the application is alive.
        """
        if time.monotonic() >= self._next_reports:
            self._next_reports = time.monotonic() + _REPORT_INTERVAL
            self._gather_reports()
            self._record_vitals()
        if self._caretaker is not None:
            self._caretaker.heard.remote()
        robots: dict[str, RobotReport] = {}
        for name in set(self._drones.values()):
            robots.update(self._ask(self._members[name].handle.robots.remote(newest)))
        over = all(self._members[name].report.phase in {"done", "failed"} for name in self._ids())
        return FlightState(robots, self.reports(), over)

    def command(self, robot: str, command: Command) -> Answer:
        """Tell a robot's mission something."""
        handle = self._members[self._drones[robot]].handle
        answer: Answer = self._ask(handle.command.remote(robot, command))
        return answer

    def reports(self) -> dict[str, ActorReport]:
        """The newest report of each actor."""
        return {name: member.report for name, member in self._members.items()}

    def infos(self) -> dict[str, ActorInfo]:
        """Where each actor lives, once launched."""
        return {m.name: m.info for m in self._members.values() if m.info is not None}

    @property
    def streams(self) -> set[str]:
        """Streams that the flight's actors publish, once launched."""
        return {stream for info in self.infos().values() for stream in info.publishes}

    def stop(self) -> dict[str, ActorReport]:
        """Stop all actors, the recorder last, and return their last reports."""
        if self._stopped:
            return self.reports()
        self._stopped = True
        last = end_actors(self._in_ending_order(), self._helpers)
        for member in self._members.values():
            member.report = last.get(member.handle, member.report)
        return self.reports()

    def _in_ending_order(self) -> list[list[Any]]:
        """All actors with streams; the recorder last, for it records the end of the others."""
        recorder = [m.handle for m in self._members.values() if m.name == "recorder"]
        others = [m.handle for m in self._members.values() if m.name != "recorder"]
        return [others, recorder]

    def _appoint_caretaker(self) -> None:
        options = self._options("caretaker", Place(), restarts=0)
        remote: Any = ray.remote(Caretaker)
        self._caretaker = remote.options(**options, max_concurrency=2).remote()
        drones = [self._members[name].handle for name in self._ids()]
        self._caretaker.watch.remote(drones, self._in_ending_order(), list(self._helpers))
        self._helpers.append(self._caretaker)

    def _ids(self) -> set[str]:
        return set(self._drones.values())

    def _create(
        self,
        name: str,
        kind: type[StreamActor],
        place: Place,
        args: tuple[Any, ...],
        *,
        restarts: int = 0,
        setup: tuple[Any, ...] = (),
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        remote: Any = ray.remote
        if kind is AnalyticsActor:
            # Calls that wait for its life to end must not keep others waiting.
            remote = remote(concurrency_groups={LIFE: 1})
        made = remote(kind).options(**self._options(name, place, restarts=restarts))
        self._members[name] = _Member(name, made.remote(*args, **kwargs), setup)

    def _options(self, name: str, place: Place, *, restarts: int) -> dict[str, Any]:
        """Ray's options; in a cluster that outlives us, actors do too, and have a name."""
        options = options_for(place, restarts=restarts)
        if self._detached:
            options |= {"lifetime": "detached", "name": f"{self.plan.session.id}/{name}"}
        return options

    def _create_dispatcher(self, dispatch: Dispatching) -> None:
        executor = works = None
        if dispatch.cloud is not None:
            # A node that comes and goes must not use restarts up: without one there is no cloud.
            options = self._options("cloud", dispatch.cloud, restarts=-1)
            slots = dispatch.resources.cloud_slots
            remote: Any = ray.remote(CloudExecutor)
            executor = remote.options(**options, max_concurrency=slots).remote()
            self._helpers.append(executor)
            works = ray.put(dispatch.works)
            self._opening.append(executor.prepare.remote(works))
        hosts = {
            node.stream: self._members[actor.name].handle
            for actor in self.plan.analyses
            for node in actor.nodes
        }
        edge = {one.stream: hosts[done_stream(one.stream)] for one in dispatch.managed}
        args = (self.plan.session, dispatch.scheduler, dispatch.managed, dispatch.resources)
        # A reference by itself would be replaced by what it refers to.
        setup = (edge, executor, [works])
        self._create("dispatcher", DispatcherActor, Place(), args, setup=setup)

    def _prepare(self, members: list[_Member], progress: Callable[[str], None]) -> None:
        waiting = {member.handle.prepare.remote(*member.setup): member for member in members}
        deadline = time.monotonic() + _PREPARE_TIMEOUT
        while waiting:
            ready, _ = ray.wait(list(waiting), timeout=max(0.0, deadline - time.monotonic()))
            if not ready:
                names = ", ".join(sorted(member.name for member in waiting.values()))
                raise MissionError(f"{names} not ready within {_PREPARE_TIMEOUT:.0f} s")
            member = waiting.pop(ready[0])
            member.info = self._ask(ready[0])
            progress(member.name)
        self._connect(members)

    def _connect(self, members: list[_Member]) -> None:
        """Tell publishers of their readers on other nodes, or without shared memory."""
        known = [member for member in self._members.values() if member.info is not None]
        references = []
        for member in members:
            assert member.info is not None  # noqa: S101 - just prepared
            here = member.info
            routes = {
                stream: [
                    reader.handle
                    for reader in known
                    if reader.info is not None
                    and stream in reader.info.reads
                    and not _share_memory(here, reader.info)
                ]
                for stream in here.publishes
            }
            routes = {stream: readers for stream, readers in routes.items() if readers}
            references.append(member.handle.connect.remote(routes))
        for reference in references:
            self._ask(reference)

    def _gather_reports(self) -> None:
        for member in self._members.values():
            self._revive(member)
            if member.pending is None:
                member.pending = member.handle.report.remote()
            ready, _ = ray.wait([member.pending], timeout=0.05)
            if not ready:
                continue
            reference, member.pending = member.pending, None
            try:
                member.report = ray.get(reference)
            except RayActorError:
                self._lost(member)

    def _record_vitals(self) -> None:
        """Have the recorder note what each process takes; it alone could not ask other nodes."""
        recorder = self._members.get("recorder")
        if recorder is None or recorder.report.phase != "running":
            return
        recorder.handle.vitals.remote(
            {
                f"{member.name}@{member.info.node_id[:8]}": member.report.vitals
                for member in self._members.values()
                if member.info is not None and member.report.vitals is not None
            }
        )

    def _lost(self, member: _Member) -> None:
        """A dead actor is reported; Ray restarts analytics, the next report finds it new."""
        error = MissionError(f"the actor {member.name} died")
        if member.name in self._ids():
            raise error
        if member.report.phase != "failed":
            for name in self._ids():
                self._members[name].handle.note.remote("actor_lost", str(error))
        member.report = ActorReport("failed", error)

    def _revive(self, member: _Member) -> None:
        """Set an actor up that Ray has restarted, without waiting: the drones need our word."""
        if member.reviving is None:
            if member.report.phase == "new" and member.info is not None:
                member.reviving = member.handle.prepare.remote(*member.setup)
        elif ray.wait([member.reviving], timeout=0)[0]:
            reference, member.reviving = member.reviving, None
            with contextlib.suppress(AeroDaaSError):  # it died again, or its next report says why
                member.info = self._ask(reference)
                self._connect([member])
                member.handle.start.remote(self._origin)
                member.report = ActorReport("running")

    @staticmethod
    def _ask(reference: Any) -> Any:  # noqa: ANN401 - whatever the actor returns
        try:
            return ray.get(reference, timeout=_ANSWER_TIMEOUT)
        except RayTaskError as error:
            cause = error.cause
            if isinstance(cause, AeroDaaSError):
                raise cause from None
            raise MissionError(f"{type(cause).__name__}: {cause}") from cause
        except RayActorError as error:
            # Ray puts the remote traceback first and what went wrong last.
            reason = str(error).strip().splitlines()[-1]
            raise MissionError(f"an actor died: {reason}") from None
        except ray.exceptions.GetTimeoutError:
            raise MissionError(f"an actor did not answer within {_ANSWER_TIMEOUT:.0f} s") from None


def _share_memory(one: ActorInfo, other: ActorInfo) -> bool:
    return one.node_id == other.node_id and one.shared_memory and other.shared_memory
