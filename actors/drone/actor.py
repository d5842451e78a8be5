"""Drone actor: the 20 Hz setpoint loop on the vehicle's edge, independent of all other actors."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any

from aerodaas.actors.base import ActorInfo, StreamActor
from aerodaas.actors.cluster.run_lock import RunLock
from aerodaas.actors.drone.background_publisher import BackgroundPublisher
from aerodaas.actors.drone.change_signal import ChangeSignal
from aerodaas.actors.drone.vehicle_controller import RobotSpec, VehicleController
from aerodaas.actors.priority import Slack, punctual, raise_niceness
from aerodaas.actors.process_variables import ProcessVariables
from aerodaas.actors.run.losses import ALONE
from aerodaas.config.file_lock import actor_lock, exclusive
from aerodaas.drivers.loading import link_of
from aerodaas.mission.commands import Answer, Command, ReturnHome
from aerodaas.mission.safety.neighbours import SILENT, Neighbours, Whereabouts
from aerodaas.runtime.loop_calls import LoopCalls, LoopOverError
from aerodaas.runtime.reports import RobotReport
from aerodaas.runtime.session import (
    CONTROL_PERIOD_NS,
    CONTROL_RATE,
    MESSAGE_DEPTH,
    Session,
    next_due,
)
from aerodaas.runtime.stream_names import reply_stream, request_stream, whereabouts_stream
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.types.errors import AeroDaaSError, MissionError, failure_line
from aerodaas.types.status import Message

__all__ = ["ANSWER_TIMEOUT", "CHANGES", "COMMANDS", "DroneActor"]

_APPLICATION_TIMEOUT = 5.0
"""Seconds without a heartbeat of the application's process after which the drone returns home."""
ANSWER_TIMEOUT = 4.0
"""Wall seconds within which the loop must execute a command; less than the sender's timeout."""
COMMANDS = "commands"
"""Concurrency group of an actor for commands only, which wait for the loop."""
CHANGES = "changes"
"""Concurrency group of an actor for the call of the application that waits for a change."""


class DroneActor(StreamActor):
    """Actor that flies `robots`."""

    niceness = 0

    def __init__(
        self,
        session: Session,
        name: str,
        robots: tuple[RobotSpec, ...],
        neighbours: tuple[str, ...] = (),
    ) -> None:
        """Create the actor `name` of `session`, which flies `robots`.

        `neighbours` are the other drone actors, from whose robots to keep separation.
        """
        depths = dict.fromkeys(_streams(robots), MESSAGE_DEPTH)
        depths.update(dict.fromkeys(map(whereabouts_stream, neighbours), 1))
        super().__init__(session, name, depths)
        self._whereabouts = Neighbours()
        """Where each robot of this actor and of the others is."""
        self._neighbours = frozenset(map(whereabouts_stream, neighbours))
        self._specs = robots
        self._controllers: dict[str, VehicleController] = {}
        self._reports: dict[str, RobotReport] = {}
        """Newest report of each robot: replaced by the loop, never mutated."""
        self._locks = ExitStack()
        self._changes = ChangeSignal()
        self._calls = LoopCalls(self._wake, self._publish_reports)
        self._publisher = BackgroundPublisher(self._unpublished)
        self._failures: dict[str, Exception] = {}
        """What ended the loop for single robots, while it goes on for the others."""
        self._late = 0
        self._refused: tuple[str, ...] = ()
        """Reasons why this machine refuses real-time priority or locked memory."""
        self._heard = time.monotonic()
        self._orphaned = False

    def prepare(self, variables: ProcessVariables | None = None) -> ActorInfo:
        """Connect the vehicles; `variables` have been set in this process by their arrival."""
        del variables
        return super().prepare()

    def _open(self) -> None:
        nice = raise_niceness()
        if nice > 0:
            self._warn_of_niceness(nice)
        self._hold_locks()
        controllers = [self._controller(spec) for spec in self._specs]
        try:
            _at_once(VehicleController.connect, controllers)
        except BaseException:
            # What one has set at its vehicle is put back, though another was not found.
            _at_once(VehicleController.disconnect, controllers)
            raise
        for spec, controller in zip(self._specs, controllers, strict=True):
            streams = (*VehicleController.streams(spec), *map(reply_stream, spec.requesters))
            controller.open({stream: self.publisher(stream) for stream in streams})
            self._controllers[controller.id] = controller
        if self._neighbours:
            self.publisher(whereabouts_stream(self.name))
        self._publish_reports()

    def _hold_locks(self) -> None:
        """Hold the drones' locks; raises MissionError where another flight's actor holds one."""
        folder = self.session.locks
        # On another machine than the provider's there are none.
        if folder is None or not folder.is_dir():
            return
        for spec in self._specs:
            path = actor_lock(folder, spec.robot.id)
            refusal = f"the actor of another flight still flies {spec.robot.id}"
            self._locks.enter_context(exclusive(path, refusal))

    def _controller(self, spec: RobotSpec) -> VehicleController:
        return VehicleController(spec, self.session, self._publisher)

    def _warn_of_niceness(self, nice: int) -> None:
        self.alert(
            "niceness",
            f"the process that flies runs at nice {nice} and must not raise itself: start "
            "this node's Ray with RAY_worker_niceness=0",
        )

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command of the application's process on one robot's mission.

        Raises MissionError if the loop does not execute it in time.
        """
        controller = self._controllers[robot]
        if robot in self._failures:
            return Answer(accepted=False, text=_failed(robot, self._failures[robot]))
        try:
            return self._calls.ask(
                lambda: controller.handle(command, self.clock.now()), ANSWER_TIMEOUT
            )
        except LoopOverError as over:
            state = self._reports[robot].status.state.value
            return Answer(accepted=False, text=f"{over}: {state}")

    def grow(self, robots: tuple[RobotSpec, ...], timeout: float) -> ActorInfo:
        """Subscribe to the streams added to `robots`; returns once the loop uses them.

        Raises MissionError if the loop has ended or does not answer.
        """
        self._calls.ask(lambda: self._grow(robots), timeout)
        return self.info()

    def use_scheduler(self, scheduler: TrajectoryScheduler, timeout: float) -> None:
        """Use the trajectory scheduler `scheduler` for all robots from now on.

        Raises MissionError if the loop has ended or does not answer.
        """
        for controller in self._controllers.values():
            # In this thread: a planner's process takes seconds to start.
            planner = controller.make_planner(scheduler)
            self._calls.ask(partial(controller.use_planner, planner), timeout)

    def _grow(self, robots: tuple[RobotSpec, ...]) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        for spec in robots:
            controller = self._controllers[spec.robot.id]
            replies = [reply_stream(node) for node in spec.requesters]
            fresh = {one: self.publisher(one) for one in replies if one not in self.publishers}
            controller.grow(spec, fresh)
        self._read(_streams(robots))
        self._specs = robots

    def _read(self, streams: Iterable[str]) -> None:
        """Subscribe to further streams, in the loop's thread."""
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        depths = dict.fromkeys(streams, MESSAGE_DEPTH)
        self.subscriber.add(depths)
        self.subscriber.subscribe_added()
        self._reads.update(depths)

    def note(self, kind: str, text: str) -> None:
        """Publish an alert of the application's process, so that it is recorded."""
        self.alert(kind, text)

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

    def await_change(self, known: int, timeout: float) -> int:
        """Return the number of changes of the missions once it is not `known`.

        Returns it after `timeout` wall seconds at the latest. A change is one of a mission's state,
        its reason, waypoints or faults, an alert, and the end. The call is no heartbeat: it may
        have been made before the application froze.
        """
        return self._changes.wait(known, timeout)

    def _publish_reports(self) -> None:
        """Replace the robots' reports; in the loop's thread only."""
        self._reports = {
            name: RobotReport(controller.status, controller.state, (), controller.loop.health)
            for name, controller in self._controllers.items()
        }
        self._changes.note((self.alerts.sent, *map(_notable, self._reports.values())))

    def _wake(self) -> None:
        if self.subscriber is not None:
            self.subscriber.wake()

    def _run(self) -> None:
        self._heard = time.monotonic()
        lock = RunLock()
        for controller in self._controllers.values():
            controller.start(self.clock)
        try:
            self._fly()
        finally:
            self._publisher.close()
            self._calls.close("the mission is over")
            self._publish_reports()
            lock.release()

    def _fly(self) -> None:
        self._publisher.start()
        with punctual() as refused:
            self._refused = refused
            self._loop()

    def _loop(self) -> None:
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
                self._guarded(controller, self._advance, now)
                # A command waits for one drone's turn, not for all of them.
                self._calls.serve()
            self._publish_whereabouts(now)
            for controller in self._controllers.values():
                self._guarded(controller, VehicleController.observe, now)
            self._watch_application()
            self._publish_reports()
            due = next_due(CONTROL_RATE, now)
            if due > self.clock.now():
                slack.use()
        if self._failures:
            raise MissionError("; ".join(_failed(*one) for one in self._failures.items()))

    def _guarded(
        self,
        controller: VehicleController,
        step: Callable[[VehicleController, int], object],
        now: int,
    ) -> None:
        """Take a step of the loop for one robot; its failure is its own, while others fly."""
        if controller.id in self._failures:
            return
        try:
            step(controller, now)
        except Exception as error:
            if len(self._controllers) == 1:
                raise
            self._failures[controller.id] = error
            controller.abandon()
            self.alert("drone_failed", _failed(controller.id, error))

    def _advance(self, controller: VehicleController, now: int) -> None:
        controller.advance_to(now)
        self._turn(controller, now)

    def _publish_whereabouts(self, now: int) -> None:
        """Tell the other drones' actors where the robots of this one are."""
        if self._neighbours:
            mine = self._whereabouts.of(self._controllers)
            self._publisher.publish(self.publishers[whereabouts_stream(self.name)], mine, now)
            for name in self._whereabouts.newly_silent(now, self._controllers):
                self.alert("neighbour_silent", _silent(name))

    def _turn(self, controller: VehicleController, now: int) -> None:
        separation = controller.mission.limits.separation
        controller.turn(now, self._whereabouts.around(controller.id, now, separation))
        state = controller.loop.state
        if state is not None:
            self._whereabouts.hear(controller.id, Whereabouts.of(state))
        source = f"drone/{controller.id}"
        for alert in controller.new_alerts():
            values = dict(alert.values)
            self._publisher.do(partial(self.tell, alert.kind, alert.text, now, values, source))

    def _take(self, message: Message[Any], now: int) -> None:
        if message.stream in self._neighbours:
            for name, where in (message.item or {}).items():
                self._whereabouts.hear(name, where)
            return
        for controller in self._controllers.values():
            controller.take(message, now)

    def _over(self) -> bool:
        return self.stopping or all(
            name in self._failures or controller.over
            for name, controller in self._controllers.items()
        )

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

    def _guard(self) -> None:
        super()._guard()
        self._changes.end()

    def _fail(self, error: AeroDaaSError) -> None:
        for controller in self._controllers.values():
            if not controller.over:
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
        _at_once(VehicleController.disconnect, list(self._controllers.values()))
        self._locks.close()


def _at_once(
    deed: Callable[[VehicleController], object], controllers: Sequence[VehicleController]
) -> None:
    """Do it for all; those that share a link, and wait for their vehicles, at the same time.

    Raises the first one's error once all are done.
    """
    if len(controllers) == 1 or any(link_of(one.spec.robot) is None for one in controllers):
        for one in controllers:
            deed(one)
        return
    with ThreadPoolExecutor(len(controllers)) as threads:
        outcomes = [threads.submit(deed, one) for one in controllers]
    for outcome in outcomes:
        outcome.result()


def _streams(robots: tuple[RobotSpec, ...]) -> list[str]:
    """Streams that the actor of these robots reads."""
    streams = [stream for robot in robots for stream in (*robot.navigation, *robot.commands)]
    return streams + [request_stream(node) for robot in robots for node in robot.requesters]


def _notable(report: RobotReport) -> tuple[object, ...]:
    """What of a report the application is told at once, rather than at its next look."""
    status = report.status
    return status.state, status.reason, len(status.visited), len(status.given_up), status.faults


def _failed(robot: str, error: Exception) -> str:
    return f"{robot}: {failure_line(error)}"


def _silent(robot: str) -> str:
    return (
        f"{robot} has told nothing of its place for {SILENT:g} s: the others keep away from where "
        "it was as from what does not give way"
    )
