"""Control of a run by the application's process: starts, monitors and stops all actors."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, cast

import ray
from ray.exceptions import ActorUnavailableError, RayActorError, RayTaskError

from aerodaas.actors.base import ActorInfo, NodeActor
from aerodaas.actors.cluster.head_watch import HeadWatch
from aerodaas.actors.cluster.liveness import ASKED_AGAIN, LIFE, LIFELINES, Life, LivenessMonitor
from aerodaas.actors.cluster.orphan_reaper import (
    REAPER,
    ApplicationProcess,
    OrphanReaperActor,
    ReaperHost,
    Watched,
)
from aerodaas.actors.cluster.ray_cluster import options_for
from aerodaas.actors.dispatch.dispatcher import DispatcherSpec
from aerodaas.actors.dispatch.executor import CloudExecutor
from aerodaas.actors.dispatch.remote_executor import Executor
from aerodaas.actors.drone.actor import COMMANDS, DroneActor
from aerodaas.actors.isolation import environment_options
from aerodaas.actors.process_variables import ProcessVariables, private_variables, vehicle_variables
from aerodaas.actors.recorder import RecorderActor, RecorderSpec
from aerodaas.actors.run.actor_state import ActorState, ask, require_clock, routes
from aerodaas.actors.run.live import live_source
from aerodaas.actors.run.losses import (
    DeadError,
    SuspensionMonitor,
    actor_silent,
    drone_lost,
)
from aerodaas.actors.run.shutdown import end_actors, may_fly
from aerodaas.clock import host_time_ns
from aerodaas.config.options import LiveViews
from aerodaas.errors import MissionError, SilentError
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import RobotStatus
from aerodaas.messages.readings import Alert
from aerodaas.mission.commands import Answer, Command
from aerodaas.recording.provenance import Provenance
from aerodaas.runtime.dispatch.offload import CloudProcess
from aerodaas.runtime.live import LiveReader
from aerodaas.runtime.placement import Placement
from aerodaas.runtime.plan import ActorPlan, DispatchPlan, FlightPlan
from aerodaas.runtime.reports import ActorReport, FlightState
from aerodaas.runtime.stream_names import done_stream

__all__ = ["Flight"]

_PREPARE_TIMEOUT = 90.0
_LOOK_TIMEOUT = 1.0
"""Timeout in seconds of a drone's actor that has answered before, so that others are looked at."""
_SILENT_AFTER = 3.0
"""Seconds without a report of an actor before the alert, which is told within five."""
_SILENT_FOR = 30.0
"""Seconds without an answer of a drone's actor after which the run has failed; it flies on."""
_NOTES_KEPT = 50
_REPORT_INTERVAL = 0.5
_RESTARTS = 3
_LOOKS = 2
"""Concurrent calls of a cloud executor reserved for probes and pings."""


class Flight:
    """The actors of one run."""

    def __init__(
        self,
        plan: FlightPlan,
        recording: Path | None = None,
        provenance: Provenance | None = None,
        live: LiveViews | None = None,
    ) -> None:
        """Create the actors of `plan`, all at once; `recording` is the path of the MCAP file.

        `live` says who looks on at what is recorded.
        """
        self.plan = plan
        # The recorder on a cluster node does not share our working directory.
        self.recording = recording.absolute() if recording and plan.recorded else None
        self._drones: dict[str, str] = {}
        self._members: dict[str, ActorState] = {}
        """By name; not changed once the flight is launched, for other threads iterate over it."""
        self._helpers: list[Any] = []
        """Actors without streams, to be killed at the end."""
        self._job = ray.get_runtime_context().get_job_id()
        self._pulse = SuspensionMonitor()
        self._opening: list[Any] = []
        self._liveness_monitor: LivenessMonitor | None = None
        self._head: HeadWatch | None = None
        session = plan.session
        environments = environment_options(plan)
        for name, specs, place in zip(plan.drone_actors, plan.drones, plan.edges, strict=True):
            self._drones.update(dict.fromkeys((spec.robot.id for spec in specs), name))
            others = tuple(other for other in plan.drone_actors if other != name)
            args, setup = (session, name, specs, others), (vehicle_variables(),)
            self._create(name, DroneActor, place, args, setup=setup)
        records = self.recording is not None and provenance is not None
        self._recorder = plan.recorder_actor if records else ""
        """Name of the actor that records; empty for none."""
        for actor in plan.actors:
            if actor.name != self._recorder:
                self._create_actor(actor, environments)
        if plan.dispatch is not None:
            self._create_dispatcher(plan.dispatch, environments)
        # Last, for its reaper knows all others.
        for actor in plan.actors:
            if actor.name == self._recorder and self.recording and provenance is not None:
                spec = RecorderSpec(self.recording, plan.recorded, provenance, live)
                args, setup = (session, actor.name, self._watched()), (*_setup(actor), spec)
                kind, place = RecorderActor, actor.place
                self._create(actor.name, kind, place, args, restarts=_RESTARTS, setup=setup)
        recorder = self._members.get(self._recorder)
        self._reaper = recorder.handle if recorder is not None else self._create_reaper()
        self._origin = 0
        self._notes: list[Alert] = []
        """Alerts of the application's process; appended to by any thread."""
        self._recordings: list[Path] = [] if self.recording is None else [self.recording]
        self._answers: dict[str, tuple[float, dict[str, RobotStatus]]] = {}
        """Time (monotonic seconds) and content of each drone actor's last answer."""
        self._next_reports = 0.0
        self._stopped = False
        self._sensed = False
        """Whether a run without drones is to end before its cameras do."""

    def launch(self, progress: Callable[[str], None] = lambda _: None) -> None:
        """Open everything and start flying; raises the errors of an actor's opening.

        `progress` is called with the name of each actor that is ready.
        """
        self._prepare(progress)
        for reference in self._opening:
            ask(reference, _PREPARE_TIMEOUT)
        # Nothing starts before the reaper runs and has a heartbeat: later ones would wait in this
        # process for the reaper's, and a suspended application sends none.
        ask(self._call_reaper("heard"), _PREPARE_TIMEOUT)
        self._pulse.beat()
        self._origin = host_time_ns()
        # Pure readers start first, so that no message is published without its readers.
        for member in reversed(self._members.values()):
            member.handle.start.remote(self._origin)
            member.report = ActorReport("running")
            member.answered_at = time.monotonic()
        mortal = {name: one.handle for name, one in self._members.items() if one.restarts}
        self._liveness_monitor = LivenessMonitor(mortal, self._life_of)
        self._head = HeadWatch(ray.get_runtime_context().gcs_address, self.publish_alert)

    def poll(self, newest: int = 200) -> FlightState:
        """State of the run, with the `newest` latencies of each robot.

        The call is also the application's heartbeat for the drones.
        """
        self._pulse.beat()
        if time.monotonic() >= self._next_reports:
            self._next_reports = time.monotonic() + _REPORT_INTERVAL
            self._gather_reports()
            self._record_vitals()
        self._call_reaper("heard")
        robots: dict[str, RobotStatus] = {}
        for name in set(self._drones.values()):
            robots.update(self._robots_of(name, newest))
        over = all(self._members[name].report.phase in {"done", "failed"} for name in self._ids())
        if not self._drones:
            over = self._sensed or self._cameras_finished()
        return FlightState(robots, self.reports(), over, self.notes)

    @property
    def notes(self) -> tuple[Alert, ...]:
        """The newest alerts of the application's process."""
        return tuple(self._notes[-_NOTES_KEPT:])

    @property
    def recordings(self) -> tuple[Path, ...]:
        """Files of the recording, in their order: a recorder that was restarted begins another."""
        return tuple(self._recordings)

    def end_sensing(self) -> None:
        """End a run without drones, which otherwise goes on as long as its cameras."""
        self._sensed = True

    def _cameras_finished(self) -> bool:
        return all(
            report.phase == "failed" or report.values.get("finished", {}).get(camera.stream)
            for actor in self.plan.actors
            for camera in actor.cameras
            for report in (self._members[actor.name].report,)
        )

    def await_end(self, timeout: float) -> None:
        """Wait for `timeout` seconds, for `poll` alone tells whether the flight is over."""
        time.sleep(timeout)

    def _robots_of(self, name: str, newest: int) -> dict[str, RobotStatus]:
        """Reports of a drone's actor; the last ones while it is too busy to answer."""
        member, before = self._members[name], self._answers.get(name)
        asked = member.handle.robots.remote(newest)
        try:
            robots: dict[str, RobotStatus] = (
                ask(asked) if before is None else ask(asked, _LOOK_TIMEOUT)
            )
        except DeadError:
            raise self._drone_lost(member) from None
        except SilentError:
            if before is None:
                raise
            silent = time.monotonic() - before[0]
            if silent > _SILENT_FOR:
                raise actor_silent(name, member.report, silent) from None
            return before[1]
        self._answers[name] = time.monotonic(), robots
        return robots

    def _drone_lost(self, member: ActorState) -> MissionError:
        """Error for a lost drone actor, which a suspended application may have caused itself."""
        frozen = self._pulse.frozen
        if frozen:
            try:
                ended = ask(self._call_reaper("ending"))
            except DeadError:
                ended = True
            except SilentError:
                ended = False
            frozen = frozen if ended else 0.0
        return drone_lost(member.name, member.report, frozen)

    @property
    def reachable(self) -> bool:
        """False after this process has left the cluster of the actors."""
        return ray.is_initialized() and ray.get_runtime_context().get_job_id() == self._job

    @property
    def flying(self) -> bool:
        """Whether a drone may be in the air and thus needs its actor."""
        drones = [self._members[name].handle for name in self._ids()]
        return any(map(may_fly, drones))

    @property
    def headless(self) -> str:
        """Address of the cluster's head if it is out of reach; else empty."""
        return self._head.address if self._head is not None and self._head.lost else ""

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command on a robot's mission.

        Args:
            robot: Id of the robot.
            command: The command.

        Raises:
            MissionError: If the robot does not fly, or its actor does not answer.
        """
        if robot not in self._drones:
            raise MissionError(f"{robot} does not fly")
        handle = self._members[self._drones[robot]].handle
        method = handle.command.options(concurrency_group=COMMANDS)
        answer: Answer = ask(method.remote(robot, command))
        return answer

    def reports(self) -> dict[str, ActorReport]:
        """The newest report of each actor."""
        return {name: member.report for name, member in self._members.items()}

    def infos(self) -> dict[str, ActorInfo]:
        """Node, process and streams of each launched actor."""
        return {m.name: m.info for m in self._members.values() if m.info is not None}

    def reader(self, stream: str, over: Callable[[], bool]) -> LiveReader | None:
        """A reader of `stream` for the application; None if no actor publishes it.

        Args:
            stream: Name of the stream.
            over: Whether the flight is over.
        """
        for name, info in self.infos().items():
            if stream in info.publishes:
                publisher = self._members[name].handle, info.node_id
                return LiveReader(live_source(self.plan.session, stream, *publisher), over)
        return None

    def stop(self) -> dict[str, ActorReport]:
        """Stop all actors, the recorder last, and return their final reports."""
        if self._stopped:
            return self.reports()
        self.detach()
        # The reaper's host last, for the application may die meanwhile.
        last = end_actors([self._ended_first(), [self._reaper]], self._helpers)
        for member in self._members.values():
            member.report = last.get(member.handle, member.report)
            self._note_file(member.report)
        recorder = self._members.get(self._recorder)
        if recorder is not None and recorder.handle not in last and recorder.report.error is None:
            files = ", ".join(map(str, self._recordings))
            error = MissionError(
                f"the recorder did not answer at the end: {files} may lack the end of the flight"
            )
            recorder.report = replace(recorder.report, error=error)
        return self.reports()

    def _note_file(self, report: ActorReport) -> None:
        path = report.values.get("path")
        if path is not None and Path(path) not in self._recordings:
            self._recordings.append(Path(path))

    def detach(self) -> None:
        """Watch no longer: the drones and all other actors are the orphan reaper's."""
        self._stopped = True
        if self._liveness_monitor is not None:
            self._liveness_monitor.end()
        if self._head is not None:
            self._head.end()

    def _ended_first(self) -> list[Any]:
        """All actors with streams but the recorder, which records their end."""
        return [member.handle for member in self._members.values() if member.name != self._recorder]

    def _watched(self) -> Watched:
        application = ApplicationProcess(time_waits=False)
        drones = [self._members[name].handle for name in self._ids()]
        return Watched(application, drones, self._ended_first(), list(self._helpers))

    def _create_reaper(self) -> Any:  # noqa: ANN401 - Ray's handle
        remote: Any = ray.remote
        made = remote(concurrency_groups={REAPER: 1})(OrphanReaperActor)
        options = self._options("orphan_reaper", Placement(), restarts=_RESTARTS)
        return made.options(**options).remote(self._watched())

    def _call_reaper(self, what: Literal["heard", "ending"]) -> Any:  # noqa: ANN401 - Ray's reference
        return getattr(self._reaper, what).options(concurrency_group=REAPER).remote()

    def _ids(self) -> set[str]:
        return set(self._drones.values())

    def _create(
        self,
        name: str,
        kind: type[NodeActor],
        place: Placement,
        args: tuple[Any, ...],
        *,
        restarts: int = 0,
        setup: tuple[Any, ...] = (),
        options: Mapping[str, Any] | None = None,
    ) -> None:
        remote: Any = ray.remote
        # Pending calls, of the liveness monitor or for the loop, must not block others.
        groups = {LIFE: LIFELINES} if restarts else {}
        groups |= {COMMANDS: 1} if issubclass(kind, DroneActor) else {}
        groups |= {REAPER: 1} if issubclass(kind, ReaperHost) else {}
        if groups:
            remote = remote(concurrency_groups=groups)
        placed = {**self._options(name, place, restarts=restarts), **(options or {})}
        made = remote(kind).options(**placed)
        self._members[name] = ActorState(name, made.remote(*args), setup, restarts)

    def _options(self, name: str, place: Placement, *, restarts: int) -> dict[str, Any]:
        """Ray options of an actor; a detached one, to outlive the application, needs a name."""
        outliving = {"lifetime": "detached", "name": f"{self.plan.session.id}/{name}"}
        return {**options_for(place, restarts=restarts), **outliving}

    def _create_actor(
        self, actor: ActorPlan, environments: Mapping[str, Mapping[str, Any]]
    ) -> None:
        args, options = (self.plan.session, actor.name), environments[actor.name]
        setup, place = _setup(actor), actor.place
        self._create(
            actor.name, NodeActor, place, args, restarts=_RESTARTS, setup=setup, options=options
        )

    def _create_dispatcher(
        self, dispatch: DispatchPlan, environments: Mapping[str, Mapping[str, Any]]
    ) -> None:
        executors = [
            self._create_executor(f"cloud/{number}/{process.site}", process, environments)
            for number, process in enumerate(dispatch.cloud)
        ]
        hosts = {
            spec.stream: self._members[actor.name].handle
            for actor in self.plan.actors
            for spec in actor.analyses
        }
        edge = {one.stream: hosts[done_stream(one.stream)] for one in dispatch.managed}
        spec = DispatcherSpec(
            dispatch.scheduler, dispatch.managed, dispatch.resources, edge, tuple(executors)
        )
        args, setup = (self.plan.session, "dispatcher"), (None, spec)
        place = Placement()
        self._create("dispatcher", NodeActor, place, args, restarts=_RESTARTS, setup=setup)

    def _create_executor(
        self, name: str, process: CloudProcess, environments: Mapping[str, Mapping[str, Any]]
    ) -> Executor:
        # Unlimited restarts, for an intermittent node: without an executor there is no cloud.
        options = {**self._options(name, process.place, restarts=-1), **environments[name]}
        remote: Any = ray.remote(CloudExecutor)
        concurrency = process.slots + _LOOKS
        handle = remote.options(**options, max_concurrency=concurrency).remote(
            self.plan.session.application
        )
        self._helpers.append(handle)
        works = ray.put(process.works)
        executor = Executor(
            process.site,
            handle,
            [works],
            frozenset(process.works),
            process.slots,
            process.codec,
            private_variables(process.runtime_env),
        )
        self._opening.append(executor.prepare())
        return executor

    def _prepare(self, progress: Callable[[str], None]) -> None:
        # Before the calls: on a busy machine the first is done before the last is made.
        began = host_time_ns()
        waiting = {one.handle.prepare.remote(*one.setup): one for one in self._members.values()}
        deadline = time.monotonic() + _PREPARE_TIMEOUT
        while waiting:
            ready, _ = ray.wait(list(waiting), timeout=max(0.0, deadline - time.monotonic()))
            if not ready:
                names = ", ".join(sorted(member.name for member in waiting.values()))
                raise MissionError(f"{names} not ready within {_PREPARE_TIMEOUT:.0f} s")
            member = waiting.pop(ready[0])
            info: ActorInfo = ask(ready[0])
            require_clock(member.name, info, began)
            member.info = info
            progress(member.name)
        for reference in [self._connect(member) for member in self._members.values()]:
            ask(reference)

    def _connect(self, member: ActorState) -> Any:  # noqa: ANN401 - Ray's reference
        """Send a publisher its readers on other nodes, or without shared memory."""
        return member.handle.connect.remote(routes(member, self._members.values()))

    def _gather_reports(self) -> None:
        for member in self._members.values():
            if member.pending is None:
                member.pending = member.handle.report.remote()
            ready, _ = ray.wait([member.pending], timeout=0.05)
            if not ready:
                self._report_silence(member)
                continue
            member.pending = None
            try:
                member.report = ray.get(ready[0])
                self._note_answer(member)
            except RayActorError:
                if member.name in self._ids():
                    raise self._drone_lost(member) from None
                # Actors with restarts are covered by the liveness monitor, which is faster.
                if not member.restarts:
                    self._lost(member)
            except RayTaskError as error:
                # A failed report of an actor must not end the supervision of the drones.
                reason = MissionError(f"no report from {member.name}: {error.cause}")
                member.report = replace(member.report, error=reason)

    def _report_silence(self, member: ActorState) -> None:
        """Raise an alert, once, for an actor that lives and has not answered for too long."""
        silence = time.monotonic() - member.answered_at
        expected = member.report.phase == "running"
        if member.silent or member.lost_at is not None or not expected or silence < _SILENT_AFTER:
            return
        # An application that was suspended itself has not had the time to hear it.
        if ray.wait([member.pending], timeout=_LOOK_TIMEOUT / 2)[0]:
            return
        member.silent = True
        self.publish_alert("actor_silent", str(actor_silent(member.name, member.report, silence)))

    def _note_answer(self, member: ActorState) -> None:
        if member.silent:
            member.silent = False
            absence = time.monotonic() - member.answered_at
            self.publish_alert("actor_back", f"{member.name} answers again after {absence:.1f} s")
        member.answered_at = time.monotonic()
        self._note_file(member.report)

    def _record_vitals(self) -> None:
        """Send the vitals of all processes to the recorder, which cannot query other nodes."""
        recorder = self._members.get(self._recorder)
        if recorder is None or recorder.report.phase != "running":
            return
        recorder.handle.vitals.remote(
            {
                f"{member.name}@{member.info.node_id[:8]}": member.report.vitals
                for member in self._members.values()
                if member.info is not None and member.report.vitals is not None
            }
        )

    def _life_of(self, name: str, life: Life) -> None:
        """Handle, in any thread, an actor that died, serves again, or will not come back."""
        member = self._members[name]
        if life == "serving":
            self._back(member)
        elif member.lost_at is None:
            self._lost(member)
            threading.Thread(target=self._revive, args=(member,), daemon=True).start()

    def _lost(self, member: ActorState) -> None:
        error = MissionError(f"the actor {member.name} died")
        if member.lost_at is None:
            member.lost_at = time.monotonic()
            self.publish_alert("actor_lost", str(error))
        member.report = ActorReport("failed", error)

    def _back(self, member: ActorState) -> None:
        if member.lost_at is not None:
            absence = time.monotonic() - member.lost_at
            member.lost_at, member.silent = None, False
            member.answered_at = time.monotonic()
            member.report = ActorReport("running")
            self.publish_alert("actor_back", f"{member.name} is back after {absence:.1f} s")

    def publish_alert(self, kind: str, text: str) -> None:
        """Publish an alert of the application's process; in any thread.

        It is told here at once, and recorded by way of the drones' actors, which may hang.

        Args:
            kind: Short machine-readable name.
            text: One sentence for the operator.
        """
        stamps = [
            report.mission.stamp
            for _, reports in tuple(self._answers.values())
            for report in reports.values()
        ]
        clock = self.plan.session.starting_at(self._origin).clock()
        header = Header(len(self._notes), max([clock.now(), *stamps]), "application")
        self._notes.append(Alert(header, kind, text))
        for name in self._ids():
            self._members[name].handle.publish_application_alert.remote(kind, text)

    def _revive(self, member: ActorState) -> None:
        """Set an actor up again, in a thread, as soon as Ray has restarted it."""
        actor, lost_at = member.handle, member.lost_at
        while member.lost_at == lost_at and not self._stopped:
            try:
                if cast("ActorReport", ray.get(actor.report.remote())).phase == "new":
                    ray.get(actor.set_origin.remote(self._origin))
                    member.info = ray.get(actor.prepare.remote(*member.setup))
                    self._connect(member)
                    ray.get(actor.start.remote(self._origin))
                    # It may hang before its next report.
                    self._note_file(ray.get(actor.report.remote()))
            except ActorUnavailableError:
                pass  # it has not restarted yet, or died again
            except RayTaskError as error:
                self.publish_alert(
                    "actor_failed", f"{member.name} cannot start again: {error.cause}"
                )
                return
            except RayActorError:
                if actor == self._reaper:
                    self._reaper = self._create_reaper()
                return
            time.sleep(ASKED_AGAIN)


def _setup(actor: ActorPlan) -> tuple[Any, ...]:
    """Arguments of an actor's `prepare`: its variables, then what it runs."""
    variables = ProcessVariables(private_variables(actor.runtime_env))
    return (variables, *actor.cameras, *actor.analyses)
