"""Dispatcher actor in lockstep whose executions take mission time, on the edge and in a cloud.

The executions themselves are simulated: a task runs at once, in its analysis' process on the edge,
and its result is published when the execution's simulated time is over. There is no cloud, no link
and no endpoint but those times. So a scheduler meets in flight what it meets in the laboratory,
and the drone flies by results as old as they would be.

Mission time goes in steps: the drone's actor says how far the next one reaches, once all frames of
the present moment are here, and goes on when everything that happens before that has happened (the
lookahead of conservative simulation: Chandy and Misra, "Distributed simulation", 1979).
"""

from __future__ import annotations

import heapq
import itertools
from collections import defaultdict, deque
from dataclasses import dataclass
from typing import Any

from aerodaas.actors.cluster.liveness import Life
from aerodaas.actors.dispatch.dispatcher import Managed
from aerodaas.actors.lockstep.dispatcher import LockstepDispatcherActor
from aerodaas.actors.lockstep.progress import Progress
from aerodaas.runtime.dispatch.executions import Executions
from aerodaas.runtime.dispatch.recent_frames import MissingFrame
from aerodaas.runtime.session import MESSAGE_DEPTH, Session
from aerodaas.runtime.stream_names import ADVANCE, PROGRESS
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Resources, Task, TaskOutcome
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Header
from aerodaas.types.status import Message

__all__ = ["TimedDispatcherActor"]


@dataclass(order=True, frozen=True)
class _Event:
    """End of an execution, or a timer; of one moment, ends come first, as in the laboratory."""

    at: int
    kind: int
    number: int
    task: Task | None = None


_END, _LOSS, _TIMER = range(3)


class TimedDispatcherActor(LockstepDispatcherActor):
    """Dispatcher actor that publishes a result when its simulated execution is over."""

    def __init__(
        self,
        session: Session,
        scheduler: AnalyticsScheduler,
        managed: tuple[Managed, ...],
        resources: Resources,
    ) -> None:
        """Create the actor of `session`, whose environment says how long executions take."""
        super().__init__(session, scheduler, managed, resources)
        self._reads[ADVANCE] = MESSAGE_DEPTH
        executions = Executions.of(session.environment.simulation)
        assert executions is not None  # noqa: S101 - else the class is another
        self._executions = executions
        self._steps: deque[Message[int]] = deque()
        """Steps of mission time that are not done yet."""
        self._events: list[_Event] = []
        self._order = itertools.count()
        self._at_work: defaultdict[str, list[Task]] = defaultdict(list)
        """Tasks that an analysis has not answered yet, by model."""
        self._failed: set[int] = set()
        self._answered: list[tuple[str, str, int]] = []

    def _open(self) -> None:
        super()._open()
        self._progress = self.publisher(PROGRESS)

    def _take(self, message: Message[Any]) -> None:
        if message.stream == ADVANCE:
            self._steps.append(message)
            # Two cameras' frames of one moment come as the host will have it.
            self._held = deque(sorted(self._held, key=lambda one: (one.stamp, one.stream, one.seq)))
        else:
            super()._take(message)

    def _receive(self, message: Message[Any]) -> None:
        self._held.append(message)
        self._tell(message)

    def _tell(self, *done: Message[Any]) -> None:
        received = tuple((one.header.source, one.header.stamp) for one in done)
        progress = Progress(received, tuple(self._answered))
        self._answered.clear()
        header = Header(self._progress.sent, self._now, PROGRESS)
        self._progress.measure(progress, header, host_time_ns())

    # Mission time.

    def _advance(self) -> None:
        while self._steps and self._reach(self._steps[0].item or 0):
            step = self._steps.popleft()
            if self._dispatch.running is None:
                self._require_decisions(self._now)
            self.follow(self._now)
            self._tell(step)
        if self._answered:
            # Of an executor that died or is back, between two steps.
            self._tell()

    def _reach(self, until: int) -> bool:
        """Let happen what happens before `until`; False while an analysis is still at work."""
        while True:
            event = self._events[0] if self._events and self._events[0].at < until else None
            frame = self._held[0] if self._held and self._held[0].stamp < until else None
            if event is not None and (frame is None or event.at <= frame.stamp):
                if event.task is not None and self._is_at_work(event.task):
                    return False
                heapq.heappop(self._events)
                self._happen(event, self._time(event.at))
            elif frame is not None:
                self._held.popleft()
                self._arrive(frame, self._time(frame.stamp))
            else:
                return True

    def _happen(self, event: _Event, now: int) -> None:
        task = event.task
        if task is None:
            self._guarded("timer", now)
        elif event.kind == _LOSS:
            self._why[task.id] = "lost in the simulated network"
            self._guarded("finished", task, now, TaskOutcome.TIMEOUT)
        elif task.id in self._failed:
            self._failed.discard(task.id)
            self._guarded("finished", task, now, TaskOutcome.FAILED)
        else:
            self._guarded("finished", task, now)

    def _add(self, at: int, kind: int, task: Task | None = None) -> None:
        heapq.heappush(self._events, _Event(at, kind, next(self._order), task))

    # Executions.

    def run_edge(self, task: Task, now: int) -> None:
        """Start a task, which ends after its time on the edge."""
        self._edge_since = now
        self._work(task, now + self._executions.edge_time(task))

    def run_cloud(self, task: Task, now: int) -> None:
        """Start a task, which ends after its time in the cloud, or is lost on the way."""
        managed = next(one for one in self._managed if one.stream == task.profile.model)
        nominal = self._executions.cloud_time(task)
        taken = self._executions.network.cloud_time(nominal, now)
        timeout = self._resources.cloud_timeout
        if not managed.offloadable:
            self._failed.add(task.id)
            self._why[task.id] = "nothing in the cloud runs it"
            self._add(now, _END, task)
        elif taken is None or taken > timeout:
            self._add(now + timeout, _LOSS, task)
        else:
            self._why[task.id] = "simulated"
            self._work(task, now + taken)

    def wake_at(self, at: int) -> None:
        """Add a time at which the scheduler is to be woken."""
        self._add(at, _TIMER)

    def _work(self, task: Task, ends: int) -> None:
        self._at_work[task.profile.model].append(task)
        self._send_task(task, self._references.item(self._frames[task.id]))
        self._add(ends, _END, task)

    def _is_at_work(self, task: Task) -> bool:
        return any(one is task for one in self._at_work[task.profile.model])

    def _edge_answered(self, managed: Managed, message: Message[Any], now: int) -> None:
        if managed.stream in self._dispatch.down and managed.stream not in self._gone:
            self._executor_is(managed.stream, "serving", now)
        at_work = self._at_work[managed.stream]
        for task in at_work:
            frame = self._frames[task.id]
            if frame.header != message.header:
                continue
            if isinstance(message.item, MissingFrame):
                self._send_task(task, frame.item)
                return
            at_work.remove(task)
            self._results[task.id] = message
            return

    def _executor_is(self, model: str, life: Life, now: int) -> None:
        """Give its work again to an executor that is back: mission time has waited for it."""
        was_down = model in self._dispatch.down
        super()._executor_is(model, life, now)
        if life == "serving" and was_down:
            for task in self._at_work[model]:
                self._send_task(task, self._frames[task.id].item)
        elif life == "gone":
            for task in self._at_work.pop(model, ()):
                self._failed.add(task.id)
                self._why[task.id] = "its executor died"

    def _lose(self, task: Task, why: str, now: int) -> None:
        """Do nothing: the task is at work until its executor is back, or gone."""

    # Answers.

    def _publish(self, node: str, origin: Message[Any], item: Any) -> None:  # noqa: ANN401
        super()._publish(node, origin, item)
        self._answered.append((node, origin.header.source, origin.header.stamp))

    def _answered_at(self, origin: Message[Any]) -> int:
        del origin
        return self._now

    def _stamp(self, origin: Message[Any]) -> int:
        del origin
        return self._now
