"""Drone actor: the 20 Hz setpoint loop on the vehicle's edge, independent of all other actors."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any

from aerodaas.actors.base import ActorInfo, NodeActor, NodeMaker
from aerodaas.actors.cluster.ray_process import RunLock
from aerodaas.actors.drone.background_publisher import BackgroundPublisher
from aerodaas.actors.drone.planner import planner_for
from aerodaas.actors.node_runner import NodeRunner
from aerodaas.actors.priority import IdleGarbageCollector, punctual, raise_niceness
from aerodaas.actors.process_variables import ProcessVariables
from aerodaas.actors.run.losses import ALONE
from aerodaas.errors import MissionError
from aerodaas.files.file_lock import actor_lock, exclusive
from aerodaas.messages.envelope import Message
from aerodaas.messages.mission import RobotStatus
from aerodaas.mission.commands import Answer, Command
from aerodaas.runtime.nodes.controller import RobotSpec
from aerodaas.runtime.nodes.drone import DroneNode, failure_of
from aerodaas.runtime.nodes.loop_calls import LoopCalls, LoopOverError
from aerodaas.runtime.session import CONTROL_PERIOD_NS, Session

__all__ = ["ANSWER_TIMEOUT", "COMMANDS", "DroneActor"]

_APPLICATION_TIMEOUT = 5.0
"""Seconds without a heartbeat of the application's process after which the drone returns home."""
ANSWER_TIMEOUT = 4.0
"""Wall seconds within which the loop must execute a command; less than the sender's timeout."""
COMMANDS = "commands"
"""Concurrency group of an actor for commands only, which wait for the loop."""


class DroneActor(NodeActor):
    """Actor that flies `robots`, and keeps them safe without the application."""

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
        super().__init__(session, name)
        self._robots = tuple(spec.robot.id for spec in robots)
        make = partial(planner_for, session)
        self._node = DroneNode(session, name, robots, make, neighbours=neighbours)
        self._reports: dict[str, RobotStatus] = {}
        """Newest report of each robot: replaced by the loop, never mutated."""
        self._locks = ExitStack()
        self._calls = LoopCalls(self._wake, self._publish_reports)
        self._background = BackgroundPublisher(self._unpublished)
        self._late = 0
        self._refused: tuple[str, ...] = ()
        """Reasons why this machine refuses real-time priority or locked memory."""
        self._heard = time.monotonic()
        self._orphaned = False

    def prepare(self, variables: ProcessVariables | None = None, *specs: NodeMaker) -> ActorInfo:
        """Connect the vehicles."""
        del variables, specs
        return super().prepare()

    def _open(self, specs: tuple[NodeMaker, ...]) -> None:
        del specs
        nice = raise_niceness()
        if nice > 0:
            self.alert(
                "niceness",
                f"the process that flies runs at nice {nice} and must not raise itself: start "
                "this node's Ray with RAY_worker_niceness=0",
            )
        self._hold_locks()
        runner = NodeRunner(self, self._node)
        runner.open([self._node])
        self.runners = [runner]
        self._publish_reports()

    def _hold_locks(self) -> None:
        """Hold the drones' locks; raises MissionError where another flight's actor holds one."""
        folder = self.session.locks
        # On another machine than the provider's there are none.
        if folder is None or not folder.is_dir():
            return
        for robot in self._robots:
            refusal = f"the actor of another flight still flies {robot}"
            self._locks.enter_context(exclusive(actor_lock(folder, robot), refusal))

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command of the application's process on one robot's mission.

        Args:
            robot: Id of the robot.
            command: The command.

        Raises:
            MissionError: If the loop does not execute it in time.
        """
        try:
            return self._calls.ask(
                lambda: self._node.command(robot, command, self.clock.now()), ANSWER_TIMEOUT
            )
        except LoopOverError as over:
            state = self._reports[robot].mission.state.value
            return Answer(accepted=False, text=f"{over}: {state}")

    def robots(self, newest: int = 200) -> dict[str, RobotStatus]:
        """Report of each robot's last loop cycle, with the `newest` latencies.

        The call is also the heartbeat of the application's process.
        """
        self._heard = time.monotonic()
        return {
            name: replace(report, latencies=self._node.latencies(name, newest))
            for name, report in self._reports.items()
        }

    def _publish_reports(self) -> None:
        """Replace the robots' reports; in the loop's thread only."""
        self._reports = self._node.reports()

    def _wake(self) -> None:
        for runner in self.runners:
            runner.wake()

    def _run(self) -> None:
        self._heard = time.monotonic()
        lock = RunLock()
        self._publish(self._node.start(self.clock))
        try:
            self._background.start()
            with punctual() as refused:
                self._refused = refused
                self._loop()
        finally:
            self._background.close()
            self._calls.close("the mission is over")
            self._publish_reports()
            lock.release()

    def _loop(self) -> None:
        (runner,) = self.runners
        node, collector = self._node, IdleGarbageCollector()
        while not (self.stopping or node.over):
            messages = runner.receive()
            self._calls.serve()
            due, now = node.due, self.clock.now()
            if messages or now >= due:
                self._publish(node.step(now, messages))
            if now < due:
                continue
            self._late += now - due > CONTROL_PERIOD_NS // 2
            self._watch_application()
            self._publish_reports()
            if node.due > self.clock.now():
                collector.use()
        if node.failures:
            raise MissionError("; ".join(failure_of(*one) for one in node.failures.items()))

    def _publish(self, messages: Iterable[Message[Any]]) -> None:
        """Hand messages to another thread, which encodes and sends them."""
        for message in messages:
            self._background.do(partial(self.publish, message))

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str = ""
    ) -> None:
        """Publish an alert, as the base does, without delaying the loop."""
        self._background.do(partial(super().publish_alert, kind, text, stamp, dict(values), source))

    def _watch_application(self) -> None:
        silent = time.monotonic() - self._heard > _APPLICATION_TIMEOUT
        if silent and not self._orphaned:
            reason = "the application's process is gone"
            self._node.return_home(reason, self.clock.now())
            self.alert("application_lost", reason)
        self._orphaned = silent

    def _unpublished(self, count: int) -> None:
        text = f"{count} messages of the setpoint loop were not published: too many waited"
        self.alert("unpublished", text)

    def fail(self, error: Exception) -> None:
        """End as failed: every drone that still flies lands by itself."""
        self._node.abandon()
        super().fail(error)

    def _values(self) -> dict[str, Any]:
        return {
            "loop_late": self._late,
            "unpublished": self._background.dropped,
            "not_granted": self._refused,
            ALONE: self._node.behaviours_alone(),
        }

    def _close(self) -> None:
        self._calls.close("the drone's actor has been stopped")
        super()._close()
        self._locks.close()
