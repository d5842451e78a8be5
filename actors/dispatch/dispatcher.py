"""Dispatcher in real time: executors on the edge that may die, and executors in the cloud.

An executor that dies is restarted by Ray; its task has failed. A cloud that is gone has no slots
until it answers again. A scheduler that is slow is replaced by edge-first EDF.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.actors.cluster.liveness import Life, LivenessMonitor
from aerodaas.actors.dispatch.edge_turns import EdgeTurns
from aerodaas.actors.dispatch.executor_pool import ExecutorPool
from aerodaas.actors.dispatch.remote_executor import Executor, RemoteResult
from aerodaas.clock import NANOSECONDS, Clock
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.runtime.dispatch.costs import DeadlineReserve, Estimates
from aerodaas.runtime.dispatch.dispatcher import Dispatcher, Managed
from aerodaas.runtime.dispatch.recent_frames import FrameReferences, MissingFrame
from aerodaas.runtime.node import Host
from aerodaas.runtime.session import Session
from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Profile,
    Resources,
    Task,
    TaskOutcome,
)

__all__ = ["DispatcherSpec", "LiveDispatcher"]

_LAST_ANSWERS = 2.0
"""Seconds to wait for the cloud's answers at the end of a run."""
_COMPLAINTS_KEPT = 16
_EDGE_PATIENCE = 4
"""An execution on the edge that takes this many times its expected time has failed."""
_LEAST_PATIENCE = NANOSECONDS
"""... but not before this: a first inference may take several."""
_LOOK = 0.2
"""Wall seconds between two looks at executors that hang, the cloud and the shared edge."""


class LiveDispatcher(Dispatcher):
    """Dispatcher for the executors of the edge and the cloud, which may be lost and come back."""

    def __init__(
        self,
        session: Session,
        scheduler: AnalyticsScheduler,
        managed: tuple[Managed, ...],
        resources: Resources,
        edge: Mapping[str, Any] | None = None,
        cloud: Sequence[Executor] = (),
    ) -> None:
        """Create the dispatcher.

        Args:
            session: The run.
            scheduler: The analytics scheduler.
            managed: Analyses whose executions it decides about.
            resources: Those of the edge and the cloud; without a cloud, it has no slots.
            edge: Actors of the analyses, by stream.
            cloud: Executors in the cloud.
        """
        super().__init__(session, scheduler, managed, resources)
        self._edge = edge or {}
        self._executors = cloud
        self._references = FrameReferences()
        self._carried = 0
        """Tasks on the edge whose frame was sent again, because its executor no longer had it."""
        self._timers: list[int] = []
        self._edge_since = 0
        self._way = DeadlineReserve()
        self._estimates = Estimates(session.speed or 1.0, scheduler.learns)
        self._complaints: deque[str] = deque(maxlen=_COMPLAINTS_KEPT)
        """Failures in the cloud that have raised an alert."""
        self._turns: EdgeTurns | None = None
        """Turns on an edge that other flights use, too; None for one of this flight alone."""
        self._dispatch.edge_open = session.edge is None
        self._cloud: ExecutorPool | None = None
        self._liveness_monitor: LivenessMonitor | None = None
        self._lives: deque[tuple[str, Life]] = deque()
        """Liveness changes of executors on the edge, from other threads."""
        self._looked = 0

    def open(self, host: Host) -> None:
        """Watch the executors."""
        super().open(host)
        timeout, speed = self._resources.cloud_timeout, self._session.speed or 1.0
        if self._executors:
            self._cloud = ExecutorPool(self._executors, timeout, host.wake, speed)
        if self._session.edge is not None:
            self._turns = EdgeTurns(self._session.edge, host.wake)

        def on_change(model: str, life: Life) -> None:
            self._lives.append((model, life))
            host.wake()

        self._liveness_monitor = LivenessMonitor(self._edge, on_change)

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Start the scheduler."""
        self._looked = clock.now()
        return super().start(clock)

    @property
    def due(self) -> int:
        """Mission time of the next timer, or of the next look at the executors."""
        look = self._looked + int(_LOOK * (self._session.speed or 1.0) * NANOSECONDS)
        return min(look, self._timers[0]) if self._timers else look

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Handle timers, answers, frames, and what has become of the executors.

        Args:
            now: Mission clock, nanoseconds.
            inputs: New messages, each stream's in order.
        """
        for message in inputs:
            self._wake_scheduler(self.host.now())
            self._receive(message, self.host.now())
        while self._lives:
            self._executor_is(*self._lives.popleft(), now)
        self._advance(self.host.now())
        self._looked = now
        return self._published()

    # Events.

    def _receive(self, message: Message[Any], now: int) -> None:
        managed = self._by_done.get(message.stream)
        if managed is not None:
            self._edge_answered(managed, message, now)
            return
        self._references.add(message)
        for one in self.managed:
            if message.stream in one.inputs:
                self._frame_arrived(one, message, now)

    def _profile(self, managed: Managed) -> Profile:
        cloud = self._cloud.expected(managed.stream) if self._cloud is not None else None
        link = self._cloud.on_the_way(managed.stream) if self._cloud is not None else 0.0
        return self._estimates.profile(managed.profile, managed.open_times, cloud, link)

    def _edge_answered(self, managed: Managed, message: Message[Any], now: int) -> None:
        if managed.stream in self._dispatch.down:
            self._executor_is(managed.stream, "serving", now)
        task = self._dispatch.running
        if task is None or task.profile.model != managed.stream:
            return
        frame = self._frames[task.id]
        if frame.header != message.header:
            return
        if isinstance(message.item, MissingFrame):
            self._send_task(task, frame.item)
            return
        self._results[task.id] = message
        self._way.travelled(message, now - self._edge_since)
        taken = self._session.host_seconds(now - self._edge_since)
        self._estimates.edge.observe(managed.stream, taken)
        self._guarded("finished", task, now)

    def _reserve(self, deadline: int) -> int:
        return self._way.reserve(deadline)

    def _executor_is(self, model: str, life: Life, now: int) -> None:
        """Handle an executor on the edge that died, is back, or will not come back."""
        down = self._dispatch.down
        if life == "serving":
            if model in down:
                down.discard(model)
                self.host.alert("executor_back", f"{model} is back on the edge")
            return
        if model not in down:
            down.add(model)
            self.host.alert("executor_lost", f"{model} died on the edge: {life}")
        running = self._dispatch.running
        if running is not None and running.profile.model == model:
            self._fail(running, "its executor on the edge died", now)

    def _advance(self, now: int) -> None:
        """Handle due timers, answers from the cloud, and hanging executions."""
        self._wake_scheduler(now)
        if self._cloud is not None:
            self._hear_from(self._cloud, now)
        running = self._dispatch.running
        if running and now - self._edge_since > self._patience_with(running.profile):
            model = running.profile.model
            self.host.alert("executor_lost", f"{model} does not answer on the edge")
            self._dispatch.down.add(model)
            self._fail(running, "it did not answer", now)
        elif running is None and self._turns is not None:
            # It decides in its turns, and those that wait for one grow old meanwhile.
            self._take_turns(self._turns, now)
        elif running is None:
            self._require_decisions(now)

    def _take_turns(self, turns: EdgeTurns, now: int) -> None:
        """On a shared edge: start a task in each turn, and ask for the next while there is one."""
        dispatch = self._dispatch
        if turns.used:
            turns.release(again=bool(dispatch.undecided))
        if dispatch.undecided:
            turns.ask()
        if turns.granted:
            dispatch.edge_open = True
            self._guarded("offer", now)
            dispatch.edge_open = False
            if dispatch.running is None:
                turns.release()

    def _wake_scheduler(self, now: int) -> None:
        """Deliver due timers to the scheduler before later events."""
        while self._timers and self._timers[0] <= now:
            self._way.delayed(now - heapq.heappop(self._timers))
            self._guarded("timer", now)

    def _patience_with(self, profile: Profile) -> int:
        """Timeout of an execution on the edge, nanoseconds."""
        return max(_EDGE_PATIENCE * profile.edge_time, _LEAST_PATIENCE)

    def _hear_from(self, cloud: ExecutorPool, now: int) -> None:
        answers = list(cloud.answers(now))
        cloud.probe(now)
        # First, so that no task is sent to a cloud that is gone.
        slots, before = cloud.slots, self._dispatch.resources.cloud_slots
        if slots != before:
            if not slots:
                self.host.alert("cloud_lost", "the cloud is gone; work stays on the edge meanwhile")
            elif slots < before:
                self.host.alert(
                    "cloud_lost", f"a part of the cloud is gone; {slots} slots are left"
                )
            else:
                self.host.alert("cloud_back", "the cloud answers again")
            self._guarded("change_resources", replace(self._resources, cloud_slots=slots), now)
        for answer in answers:
            self._cloud_answered(answer, now)

    def _cloud_answered(self, answer: RemoteResult, now: int) -> None:
        task = answer.task
        if answer.way:
            self._reasons[task.id] = answer.way
        if answer.figures is not None:
            self._figures[task.id] = answer.figures
        if answer.lost:
            self._fail(task, answer.error, now)
        elif answer.timed_out:
            self._reasons[task.id] = answer.error
            self._guarded("finished", task, now, TaskOutcome.TIMEOUT)
        elif answer.message is None:
            self._reasons[task.id] = answer.error
            if answer.error not in self._complaints:
                self._complaints.append(answer.error)
                self.host.alert(
                    "cloud_failed", f"{task.profile.model} {answer.way}: {answer.error}"
                )
            self._guarded("finished", task, now, TaskOutcome.FAILED)
        else:
            self._results[task.id] = answer.message
            self._guarded("finished", task, now)

    def _fail(self, task: Task, why: str, now: int) -> None:
        self._reasons[task.id] = why
        self._guarded("finished", task, now, TaskOutcome.FAILED)

    # Host interface of `Dispatch`.

    def run_edge(self, task: Task, now: int) -> None:
        """Send a task to its analysis' executor on the edge."""
        self._edge_since = now
        if self._turns is not None:
            self._dispatch.edge_open, self._turns.used = False, True
        self._send_task(task, self._references.item(self._frames[task.id]))

    def _send_task(self, task: Task, item: object) -> None:
        self._carried += isinstance(item, Frame)
        super()._send_task(task, item)

    def run_cloud(self, task: Task, now: int) -> None:
        """Send a task to the cloud."""
        if self._cloud is not None:
            left = self._session.host_seconds(task.deadline + task.reserve - now)
            self._cloud.send(task, self._frames[task.id], now, left)

    def wake_at(self, at: int) -> None:
        """Store a time at which the scheduler is to be woken."""
        heapq.heappush(self._timers, at)

    def close(self) -> None:
        """Wait for the cloud's last answers; end what watches the executors."""
        if self._liveness_monitor is not None:
            self._liveness_monitor.end()
        if self._cloud is not None:
            self._cloud.finish(_LAST_ANSWERS)
        if self._turns is not None:
            self._turns.close()
        super().close()

    def values(self) -> dict[str, Any]:
        """The base's figures, and those of the executors."""
        return {
            **super().values(),
            "frames_carried": self._carried,
            "reserve_ms": self._way.reserve(1 << 62) / 1e6,
            "sites": self._cloud.values() if self._cloud is not None else {},
        }


@dataclass(frozen=True)
class DispatcherSpec:
    """Specification of the dispatcher for its actor."""

    scheduler: AnalyticsScheduler
    managed: tuple[Managed, ...]
    resources: Resources
    edge: Mapping[str, Any]
    """Actors of the analyses, by stream."""
    cloud: Sequence[Executor]
    niceness: int = 5
    """Of its process."""

    def make(self, session: Session) -> LiveDispatcher:
        """Make the node."""
        return LiveDispatcher(
            session, self.scheduler, self.managed, self.resources, self.edge, self.cloud
        )
