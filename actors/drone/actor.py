"""Drone actor: the 20 Hz setpoint loop on the vehicle's edge, independent of all other actors.

In real time each robot has an actor of its own. In lockstep one actor flies all the simulated
robots of a run and conducts mission time: it advances to the next due time, publishes the
measurements, and continues once all analyses that can affect a drone have processed them.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from aerodaas.actors.base import ActorInfo, StreamActor
from aerodaas.actors.cluster.run_lock import RunLock
from aerodaas.actors.drone.background_publisher import BackgroundPublisher
from aerodaas.actors.drone.loop_calls import LoopCalls, LoopOverError
from aerodaas.actors.drone.robot_report import RobotReport
from aerodaas.actors.drone.vehicle_controller import RobotSpec, VehicleController
from aerodaas.actors.lockstep.barrier import Barrier
from aerodaas.actors.lockstep.growth_gate import GrowthGate
from aerodaas.actors.priority import Slack, punctual, raise_niceness
from aerodaas.actors.run.losses import ALONE
from aerodaas.actors.session import (
    CONTROL_PERIOD_NS,
    CONTROL_RATE,
    MESSAGE_DEPTH,
    NEVER,
    Session,
    next_due,
)
from aerodaas.actors.stream_names import (
    ACKS,
    end_stream,
    reply_stream,
    request_stream,
    state_stream,
)
from aerodaas.mission.commands import Answer, Command, ReturnHome
from aerodaas.mission.safety.setpoint_filter import Neighbour
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.types.clock import LockstepClock
from aerodaas.types.errors import AeroDaaSError
from aerodaas.types.status import Message
from aerodaas.types.vehicle import VehicleState

__all__ = ["COMMANDS", "DroneActor", "LockstepSchedule"]

_APPLICATION_TIMEOUT = 5.0
"""Seconds without a heartbeat of the application's process after which the drone returns home."""
_ANSWER_TIMEOUT = 4.0
"""Wall seconds within which the loop must execute a command; less than the sender's timeout."""
COMMANDS = "commands"
"""Concurrency group of an actor for commands only, which wait for the loop."""


@dataclass(frozen=True)
class LockstepSchedule:
    """Sources and acknowledgements of a lockstep run, for the actor that conducts its time."""

    rates: dict[str, float] = field(default_factory=dict)
    """Rates in Hz of the sources of other actors (cameras, external analyses)."""
    acknowledgements: dict[str, int] = field(default_factory=dict)
    """Number of acknowledgements of one measurement, by source."""
    windows: dict[str, int] = field(default_factory=dict)
    """Most unprocessed measurements while time advances, by source."""
    readers: tuple[str, ...] = ()
    """Streams of acknowledgements."""
    patience: float = 20.0
    """Timeout of an acknowledgement in wall seconds."""


class DroneActor(StreamActor):
    """Actor that flies `robots`."""

    niceness = 0

    def __init__(
        self,
        session: Session,
        name: str,
        robots: tuple[RobotSpec, ...],
        conduct: LockstepSchedule,
        neighbours: tuple[str, ...] = (),
    ) -> None:
        """Create the actor `name` of `session`; `conduct` is used in lockstep only.

        `neighbours` are the robots of other actors, from which to keep separation.
        """
        depths = dict.fromkeys(_streams(robots, conduct), MESSAGE_DEPTH)
        depths.update(dict.fromkeys((state_stream(other) for other in neighbours), 1))
        super().__init__(session, name, depths)
        self._conduct = conduct
        self._whereabouts: dict[str, Neighbour] = {}
        self._neighbours = {state_stream(other): other for other in neighbours}
        self._steering = {stream for robot in robots for stream in robot.navigation}
        self._specs = robots
        self._controllers: dict[str, VehicleController] = {}
        self._reports: dict[str, RobotReport] = {}
        """Newest report of each robot: replaced by the loop, never mutated."""
        self._calls = LoopCalls(self._wake, self._publish_reports)
        self._publisher = BackgroundPublisher(self._unpublished)
        self._gate = GrowthGate(self._calls.serve)
        self._due: dict[str, int] = {}
        self._late = 0
        self._refused: tuple[str, ...] = ()
        """Reasons why this machine refuses real-time priority or locked memory."""
        self._heard = time.monotonic()
        self._orphaned = False

    def _open(self) -> None:
        nice = raise_niceness()
        if nice > 0 and not self.session.lockstep:
            self.alert(
                "niceness",
                f"the process that flies runs at nice {nice} and must not raise itself: start "
                "this node's Ray with RAY_worker_niceness=0",
            )
        for spec in self._specs:
            controller = VehicleController(spec, self.session, self._publisher)
            streams = (*VehicleController.streams(spec), *map(reply_stream, spec.requesters))
            controller.open({stream: self.publisher(stream) for stream in streams})
            self._controllers[controller.id] = controller
        self._publish_reports()

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command of the application's process on one robot's mission.

        Raises MissionError if the loop does not execute it in time.
        """
        controller = self._controllers[robot]
        try:
            return self._calls.ask(
                lambda: controller.handle(command, self.clock.now()), _ANSWER_TIMEOUT
            )
        except LoopOverError as over:
            state = self._reports[robot].status.state.value
            return Answer(accepted=False, text=f"{over}: {state}")

    def hold(self, timeout: float) -> bool:
        """In lockstep, hold mission time; returns False if not held within `timeout` seconds."""
        return self._gate.hold(timeout)

    def release(self) -> None:
        """Let mission time advance again."""
        self._gate.release()

    def grow(
        self, robots: tuple[RobotSpec, ...], conduct: LockstepSchedule, timeout: float
    ) -> ActorInfo:
        """Subscribe to the streams added to `robots`; returns once the loop uses them.

        Raises MissionError if the loop has ended or does not answer.
        """
        self._calls.ask(lambda: self._grow(robots, conduct), timeout)
        return self.info()

    def use_scheduler(self, scheduler: TrajectoryScheduler, timeout: float) -> None:
        """Use the trajectory scheduler `scheduler` for all robots from now on.

        Raises MissionError if the loop has ended or does not answer.
        """
        for controller in self._controllers.values():
            # In this thread: a planner's process takes seconds to start.
            planner = controller.make_planner(scheduler)
            self._calls.ask(partial(controller.use_planner, planner), timeout)

    def _grow(self, robots: tuple[RobotSpec, ...], conduct: LockstepSchedule) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        for spec in robots:
            controller = self._controllers[spec.robot.id]
            replies = [reply_stream(node) for node in spec.requesters]
            fresh = {one: self.publisher(one) for one in replies if one not in self.publishers}
            controller.grow(spec, fresh)
        depths = dict.fromkeys(_streams(robots, conduct), MESSAGE_DEPTH)
        self.subscriber.add(depths)
        self.subscriber.subscribe_added()
        self._reads.update(depths)
        self._specs, self._conduct = robots, conduct
        self._steering = {stream for robot in robots for stream in robot.navigation}
        if self.session.lockstep:
            self._barrier.windows = conduct.windows
            for source in conduct.rates:
                self._due.setdefault(source, self._next_due(source, self.clock.now()))

    def note(self, kind: str, text: str) -> None:
        """Publish an alert of the application's process, so that it is recorded."""
        self.alert(kind, text)

    def wait_no_longer(self) -> None:
        """In lockstep, stop waiting for current acknowledgements, as a reader died or is new."""
        if self.session.lockstep:
            with contextlib.suppress(LoopOverError):
                self._calls.ask(self._barrier.forget, _ANSWER_TIMEOUT)

    def robots(self, newest: int = 200) -> dict[str, RobotReport]:
        """Report of each robot's last loop cycle, with the `newest` latencies.

        The call is also the heartbeat of the application's process.
        """
        self._heard = time.monotonic()
        controllers = self._controllers
        return {
            name: replace(report, latencies=controllers[name].latencies.newest(newest))
            for name, report in self._reports.items()
        }

    def _publish_reports(self) -> None:
        """Replace the robots' reports; in the loop's thread only."""
        self._reports = {
            name: RobotReport(controller.status, controller.state, (), self._late)
            for name, controller in self._controllers.items()
        }

    def _wake(self) -> None:
        if self.subscriber is not None:
            self.subscriber.wake()

    def _run(self) -> None:
        self._heard = time.monotonic()
        lock = RunLock()
        for controller in self._controllers.values():
            controller.start(self.clock)
        try:
            if self.session.lockstep:
                self._run_lockstep()
            else:
                self._publisher.start()
                with punctual() as refused:
                    self._refused = refused
                    self._run_real_time()
        finally:
            self._publisher.close()
            self._calls.close("the mission is over")
            self._publish_reports()
            lock.release()

    def _run_real_time(self) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        due, slack = self.clock.now(), Slack()
        while not self._over():
            wait = self.session.host_seconds(max(0, due - self.clock.now()))
            for message in self.subscriber.receive(wait):
                self._take(message, self.clock.now())
            self._calls.serve()
            now = self.clock.now()
            if now < due:
                continue
            self._late += now - due > CONTROL_PERIOD_NS // 2
            for controller in self._controllers.values():
                controller.advance_to(now)
                self._turn(controller, now)
            for controller in self._controllers.values():
                controller.observe(now)
            self._watch_application()
            self._publish_reports()
            due = next_due(CONTROL_RATE, now)
            if due > self.clock.now():
                slack.use()

    def _run_lockstep(self) -> None:
        assert isinstance(self.clock, LockstepClock)  # noqa: S101 - the session says so
        self._barrier = Barrier(self._conduct.windows)
        self._due = {source: self._next_due(source, -1) for source in self._conduct.rates}
        due = 0
        while not self._over():
            self._gate.visit(lambda: self._await(drain=True))
            readings = [controller.next_reading for controller in self._controllers.values()]
            now = min([due, *self._due.values(), *readings])
            if now == NEVER:
                break
            self.clock.advance_to(now)
            for controller in self._controllers.values():
                controller.advance_to(now)
                if now == due:
                    self._turn(controller, now)
            if now == due:
                due = next_due(CONTROL_RATE, now)
            self._measure(now)
            self._publish_reports()
            self._await(drain=False)
        self._await(drain=True)

    def _next_due(self, source: str, after: int) -> int:
        return self.session.next_due(source, self._conduct.rates[source], after)

    def _measure(self, now: int) -> None:
        """Publish the vehicles' measurements, and expect those of the sources that are due."""
        counts = self._conduct.acknowledgements
        for source, stamp in self._due.items():
            if stamp == now:
                self._barrier.expect(source, now, counts.get(source, 0))
                self._due[source] = self._next_due(source, now)
        for controller in self._controllers.values():
            for stream, stamp in controller.observe(now):
                self._barrier.expect(stream, stamp, counts.get(stream, 0))

    def _await(self, *, drain: bool) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        given_up = time.monotonic() + self._conduct.patience
        arrived: list[Message[Any]] = []
        while not self.stopping:
            clear = self._barrier.clear(drain=drain)
            messages = self.subscriber.receive(0.0 if clear else 0.5)
            self._calls.serve()
            for message in messages:
                self._acknowledge(message)
                if not message.stream.startswith(ACKS):
                    arrived.append(message)
            if clear:
                break
            if messages:
                given_up = time.monotonic() + self._conduct.patience
            elif time.monotonic() > given_up:
                sources = ", ".join(self._barrier.waiting_for())
                self.alert("reader_lost", f"no reader answers for {sources}; flying on without")
                self._barrier.forget()
        now = self.clock.now()
        # The order of arrival depends on the host's scheduler; that of processing must not.
        for message in sorted(arrived, key=_order):
            self._take(message, now)

    def _acknowledge(self, message: Message[Any]) -> None:
        if message.stream.startswith(ACKS):
            for source, stamp in message.item or ():
                self._barrier.acknowledge(source, stamp)
        elif message.stream in self._steering:
            self._barrier.acknowledge(message.header.source, message.header.stamp)

    def _turn(self, controller: VehicleController, now: int) -> None:
        others = [where for name, where in self._whereabouts.items() if name != controller.id]
        controller.turn(now, others)
        state = controller.loop.state
        if state is not None:
            self._whereabouts[controller.id] = _neighbour(state)
        for alert in controller.new_alerts():
            self._publisher.do(partial(self.tell, alert.kind, alert.text, now, dict(alert.values)))

    def _take(self, message: Message[Any], now: int) -> None:
        if message.stream in self._neighbours and isinstance(message.item, VehicleState):
            self._whereabouts[self._neighbours[message.stream]] = _neighbour(message.item)
            return
        for controller in self._controllers.values():
            controller.take(message, now)

    def _over(self) -> bool:
        return self.stopping or all(controller.over for controller in self._controllers.values())

    def _watch_application(self) -> None:
        silent = time.monotonic() - self._heard > _APPLICATION_TIMEOUT
        if silent and not self._orphaned:
            reason = "the application's process is gone"
            for controller in self._controllers.values():
                controller.handle(ReturnHome(reason), self.clock.now())
            self.alert("application_lost", reason)
        self._orphaned = silent

    def _unpublished(self, count: int) -> None:
        text = f"{count} messages of the setpoint loop were not published: too many waited"
        self.alert("unpublished", text)

    def _fail(self, error: AeroDaaSError) -> None:
        for controller in self._controllers.values():
            controller.abandon()
        super()._fail(error)

    def _values(self) -> dict[str, Any]:
        alone = {
            name: controller.vehicle.capabilities.alone
            for name, controller in self._controllers.items()
        }
        return {
            "loop_late": self._late,
            "unpublished": self._publisher.dropped,
            "not_granted": self._refused,
            ALONE: alone,
        }

    def _close(self) -> None:
        self._calls.close("the drone's actor has been stopped")
        for controller in self._controllers.values():
            controller.vehicle.close()


def _streams(robots: tuple[RobotSpec, ...], conduct: LockstepSchedule) -> list[str]:
    """Streams that the actor of these robots reads."""
    streams = [stream for robot in robots for stream in (*robot.navigation, *robot.commands)]
    streams += [request_stream(node) for robot in robots for node in robot.requesters]
    return [*streams, *conduct.readers]


def _order(message: Message[Any]) -> tuple[bool, str, int]:
    """Sort key of messages: results of a camera's last image before the camera's end command."""
    return message.stream.endswith(end_stream("")), message.stream, message.seq


def _neighbour(state: VehicleState) -> Neighbour:
    return Neighbour(state.odometry.position, state.odometry.velocity)
