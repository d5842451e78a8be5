"""Drone actor in lockstep: flies all simulated robots of a run and conducts mission time."""

from __future__ import annotations

import contextlib
import time
from typing import Any

from aerodaas.actors.base import ActorInfo
from aerodaas.actors.drone.actor import ANSWER_TIMEOUT, DroneActor
from aerodaas.actors.drone.vehicle_controller import RobotSpec, VehicleController
from aerodaas.actors.lockstep.actor import LockstepActor
from aerodaas.actors.lockstep.barrier import Barrier
from aerodaas.actors.lockstep.growth_gate import GrowthGate
from aerodaas.actors.lockstep.progress import Progress
from aerodaas.actors.lockstep.schedule import LockstepSchedule
from aerodaas.actors.streams import Publisher
from aerodaas.mission.planner import InlinePlanner, Planner
from aerodaas.runtime.loop_calls import LoopOverError
from aerodaas.runtime.session import CONTROL_RATE, MESSAGE_DEPTH, NEVER, Session, next_due
from aerodaas.runtime.stream_names import ACKS, ADVANCE, end_stream
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.types.clock import LockstepClock, host_time_ns
from aerodaas.types.data import Header
from aerodaas.types.status import Message

__all__ = ["LockstepDroneActor"]


class LockstepDroneActor(LockstepActor, DroneActor):
    """Drone actor that advances mission time.

    It advances to the next due time, publishes the measurements, and continues once all analyses
    that can affect a drone have processed them.
    """

    def __init__(
        self,
        session: Session,
        name: str,
        robots: tuple[RobotSpec, ...],
        schedule: LockstepSchedule,
    ) -> None:
        """Create the actor `name` of `session`, which flies `robots` by `schedule`."""
        super().__init__(session, name, robots)
        self._reads.update(dict.fromkeys(schedule.readers, MESSAGE_DEPTH))
        self._schedule = schedule
        self._barrier = Barrier(schedule.windows)
        self._gate = GrowthGate(self._calls.serve)
        self._steps: Publisher | None = None
        self._due: dict[str, int] = {}

    def _open(self) -> None:
        super()._open()
        if self._schedule.answers:
            self._steps = self.publisher(ADVANCE)

    def hold(self, timeout: float) -> bool:
        """Hold mission time; returns False if not held within `timeout` wall seconds."""
        return self._gate.hold(timeout)

    def release(self) -> None:
        """Let mission time advance again."""
        self._gate.release()

    def use_schedule(self, schedule: LockstepSchedule, timeout: float) -> ActorInfo:
        """Use the `schedule` of a graph that has grown; returns once the loop uses it.

        Raises MissionError if the loop has ended or does not answer.
        """
        self._calls.ask(lambda: self._use_schedule(schedule), timeout)
        return self.info()

    def _use_schedule(self, schedule: LockstepSchedule) -> None:
        self._read(schedule.readers)
        self._schedule = schedule
        self._barrier.windows = schedule.windows
        for source in schedule.rates:
            self._due.setdefault(source, self._next_due(source, self.clock.now()))

    def wait_no_longer(self) -> None:
        """Stop waiting for current acknowledgements, as a reader died or is new."""
        with contextlib.suppress(LoopOverError):
            self._calls.ask(self._barrier.forget, ANSWER_TIMEOUT)

    def _controller(self, spec: RobotSpec) -> VehicleController:
        return _LockstepController(spec, self.session, self._publisher)

    def _warn_of_niceness(self, nice: int) -> None:
        """Do nothing: mission time waits for a slow process."""

    def _fly(self) -> None:
        assert isinstance(self.clock, LockstepClock)  # noqa: S101 - the session says so
        self._due = {source: self._next_due(source, -1) for source in self._schedule.rates}
        due = 0
        while not self._over():
            self._gate.visit(lambda: self._await(drain=True))
            now = self._next(due)
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
            if self._steps is not None:
                self._let_executions_end(self._steps, now, self._next(due))
        self._await(drain=True)

    def _next(self, due: int) -> int:
        """The next moment at which something is due, `due` being the loop's next turn."""
        readings = [controller.next_reading for controller in self._controllers.values()]
        return min([due, *self._due.values(), *readings])

    def _let_executions_end(self, steps: Publisher, now: int, until: int) -> None:
        """Wait for the results of simulated executions that end before `until`."""
        self._barrier.expect(ADVANCE, now, 1)
        steps.measure(until, Header(steps.sent, now, ADVANCE), host_time_ns())
        self._await(drain=False)

    def _next_due(self, source: str, after: int) -> int:
        return self.session.next_due(source, self._schedule.rates[source], after)

    def _measure(self, now: int) -> None:
        """Publish the vehicles' measurements, and expect those of the sources that are due."""
        counts = self._schedule.acknowledgements
        for source, stamp in self._due.items():
            if stamp == now:
                self._barrier.expect(source, now, counts.get(source, 0))
                self._due[source] = self._next_due(source, now)
        for controller in self._controllers.values():
            for stream, stamp in controller.observe(now):
                self._barrier.expect(stream, stamp, counts.get(stream, 0))

    def _await(self, *, drain: bool) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        given_up = time.monotonic() + self._schedule.patience
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
                given_up = time.monotonic() + self._schedule.patience
            elif time.monotonic() > given_up:
                sources = ", ".join(self._barrier.waiting_for())
                self.alert("reader_lost", f"no reader answers for {sources}; flying on without")
                self._barrier.forget()
        now = self.clock.now()
        # The order of arrival depends on the host's scheduler; that of processing must not.
        for message in sorted(arrived, key=_order):
            self._take(message, now)

    def _acknowledge(self, message: Message[Any]) -> None:
        if isinstance(message.item, Progress):
            for stream, source, stamp in message.item.answered:
                self._barrier.expect(source, stamp, self._schedule.answers[stream])
            for source, stamp in message.item.received:
                self._barrier.acknowledge(source, stamp)
        elif message.stream.startswith(ACKS):
            for source, stamp in message.item or ():
                self._barrier.acknowledge(source, stamp)
        elif any(message.stream in spec.navigation for spec in self._specs):
            self._barrier.acknowledge(message.header.source, message.header.stamp)


class _LockstepController(VehicleController):
    """Controller that depends on nothing but mission time."""

    def make_planner(self, scheduler: TrajectoryScheduler) -> Planner:
        """Create a planner in the loop itself, so that plans do not depend on the host's speed."""
        return InlinePlanner(scheduler)

    def _publish_takeoff(self, now: int) -> None:
        """Do nothing: the first cycle, at 0 s, publishes this state."""


def _order(message: Message[Any]) -> tuple[bool, str, int]:
    """Sort key of messages: results of a camera's last image before the camera's end command."""
    return message.stream.endswith(end_stream("")), message.stream, message.seq
