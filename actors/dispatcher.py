"""The dispatcher's actor: an analytics scheduler decides live what runs where, and when.

The scheduler is the very class that the lab studies, driven through the same `Dispatch`. Each
frame becomes a task for each managed analysis. The edge executor is serial, as in the model that
the schedulers were made for: whichever analysis it is, one runs at a time. The dispatcher alone
publishes the analyses' results, so that a result that comes too late goes nowhere.
"""

from __future__ import annotations

import heapq
import itertools
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

from aerodaas.actors._barrier import ACKS
from aerodaas.actors._base import StreamActor, failure_line
from aerodaas.actors._cloud import Cloud
from aerodaas.actors.session import FRAME_DEPTH, MESSAGE_DEPTH, Session
from aerodaas.clock import host_time_ns
from aerodaas.data import Header
from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Decision,
    Drop,
    Outcome,
    Profile,
    Resources,
    Result,
    RunOnEdge,
    Task,
    WakeAt,
)
from aerodaas.schedulers.analytics.dispatch import Dispatch
from aerodaas.schedulers.analytics.edge_cloud import EdgeCloudEdf
from aerodaas.status import Decision as DecisionRecord
from aerodaas.status import Message

__all__ = ["DECISIONS", "DispatcherActor", "Managed", "done_stream", "task_stream"]

DECISIONS = "decisions"
"""Stream of the scheduler's decisions and their outcomes."""
_LAST_ANSWERS = 2.0
"""Seconds given to the cloud at the end of a run."""
_EDGE_PATIENCE = 10
"""An execution on the edge that takes so many times its expected time has failed."""
_SLOW_DECISION = 0.05
"""Seconds that the scheduler may think about one event before it is replaced."""


def task_stream(node: str) -> str:
    """Stream on which the edge executor of an analysis gets its tasks."""
    return f"{node}/tasks"


def done_stream(node: str) -> str:
    """Stream on which the edge executor of an analysis answers."""
    return f"{node}/done"


@dataclass(frozen=True)
class Managed:
    """One analysis under the dispatcher."""

    stream: str
    inputs: tuple[str, ...]
    profile: Profile
    """Its model's name is the stream."""
    acknowledges: bool = False
    """True in lockstep for an analysis whose results nobody reads."""


class DispatcherActor(StreamActor):
    """Drives `scheduler` over the executors of the `managed` analyses."""

    def __init__(
        self,
        session: Session,
        scheduler: AnalyticsScheduler,
        managed: tuple[Managed, ...],
        resources: Resources,
    ) -> None:
        """Belong to `session`; without a cloud, `resources` has no slots there."""
        inputs = dict.fromkeys((s for one in managed for s in one.inputs), FRAME_DEPTH)
        answers = dict.fromkeys((done_stream(one.stream) for one in managed), MESSAGE_DEPTH)
        super().__init__(session, "dispatcher", {**inputs, **answers})
        self._managed = managed
        self._by_done = {done_stream(one.stream): one for one in managed}
        self._resources = resources
        self._dispatch = Dispatch(scheduler, resources, self)
        self._replaced = False
        self._numbers = itertools.count()
        self._frames: dict[int, Message[Any]] = {}
        self._results: dict[int, Message[Any]] = {}
        self._timers: list[int] = []
        self._edge_since = 0
        self._now = 0
        self._outcomes: Counter[str] = Counter()
        self._utility = 0.0

    def prepare(self, cloud: Any = None) -> Any:  # noqa: ANN401 - a Ray handle; the base's info
        """Open the streams; `cloud` is the executor in the cloud, where there is one."""
        info = super().prepare()
        assert self.inbox is not None  # noqa: S101 - prepared
        timeout = self._resources.cloud_timeout
        self._cloud = Cloud(cloud, timeout, self.inbox.wake) if cloud is not None else None
        return info

    def _open(self) -> None:
        self._decisions = self.outlet(DECISIONS)
        self._tasks = {one.stream: self.outlet(task_stream(one.stream)) for one in self._managed}
        self._acks = {
            one.stream: self.outlet(f"{ACKS}/{one.stream}")
            for one in self._managed
            if one.acknowledges and self.session.lockstep
        }
        self._answers = {one.stream: self.outlet(one.stream) for one in self._managed}

    def _run(self) -> None:
        assert self.inbox is not None  # noqa: S101 - prepare came first
        self._guarded("start", self._time())
        while not self.stopping:
            for message in self.inbox.receive(self._patience()):
                self._take(message)
            if self.session.lockstep:
                self._settle()
            else:
                self._catch_up()

    # What happens.

    def _take(self, message: Message[Any]) -> None:
        now = self._time(message.stamp)
        managed = self._by_done.get(message.stream)
        if managed is not None:
            self._edge_answered(managed, message, now)
            return
        for one in self._managed:
            if message.stream in one.inputs:
                self._frame_arrived(one, message, now)

    def _frame_arrived(self, managed: Managed, message: Message[Any], now: int) -> None:
        if message.item is None:
            self._publish(managed.stream, message, None)
            return
        profile = managed.profile
        task = Task(
            id=next(self._numbers),
            profile=profile,
            arrival=now,
            deadline=now + profile.deadline,
            source=message.header.source,
            segment=message.header.id,
        )
        self._frames[task.id] = message
        self._guarded("arrived", task, now)

    def _edge_answered(self, managed: Managed, message: Message[Any], now: int) -> None:
        task = self._dispatch.running
        if task is None or task.profile.model != managed.stream:
            return
        if self._frames[task.id].header != message.header:
            return
        self._results[task.id] = message
        self._guarded("finished", task, now)

    def _catch_up(self) -> None:
        """Real time: timers that are due, answers from the cloud, executions that hang."""
        now = self._time()
        while self._timers and self._timers[0] <= now:
            heapq.heappop(self._timers)
            self._guarded("timer", now)
        for task, answer, timed_out in self._cloud.answers(now) if self._cloud else ():
            if answer is not None:
                self._results[task.id] = answer
            failure = Outcome.TIMEOUT if timed_out else Outcome.FAILED
            self._guarded("finished", task, now, None if answer is not None else failure)
        running = self._dispatch.running
        if running and now - self._edge_since > _EDGE_PATIENCE * running.profile.edge_time:
            self.alert("executor_lost", f"{running.profile.model} does not answer on the edge")
            self._guarded("finished", running, now, Outcome.FAILED)

    def _settle(self) -> None:
        """Lockstep: let the scheduler's own time run on until every task is decided."""
        if self._dispatch.running is not None:
            return
        while self._dispatch.undecided and self._dispatch.running is None:
            if not self._timers:
                self._replace("left tasks undecided without asking to be woken", self._now)
                return
            self._now = max(self._now, heapq.heappop(self._timers))
            self._guarded("timer", self._now)

    def _guarded(self, event: str, *args: Any) -> None:  # noqa: ANN401
        """Tell the scheduler; one that raises, talks nonsense or is slow is replaced."""
        began = time.perf_counter()
        now = next(arg for arg in reversed(args) if isinstance(arg, int))
        try:
            getattr(self._dispatch, event)(*args)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self._replace(failure_line(error), now)
        else:
            if time.perf_counter() - began > _SLOW_DECISION and not self.session.lockstep:
                self._replace(f"took more than {_SLOW_DECISION * 1000:.0f} ms to decide", now)

    def _replace(self, why: str, now: int) -> None:
        name = type(self._dispatch.scheduler).__name__
        if self._replaced:
            self.alert("scheduler_failed", f"{name}: {why}")
            return
        self._replaced = True
        self.alert("scheduler_failed", f"{name}: {why}; going on with edge-first EDF")
        self._dispatch.replace(EdgeCloudEdf(), now)

    # The host of `Dispatch`.

    def run_edge(self, task: Task, now: int) -> None:
        """Give a task to its analysis' executor on the edge."""
        frame = self._frames[task.id]
        self._edge_since = now
        self._tasks[task.profile.model].derive(frame.item, frame, host_time_ns(), frame.stamp)

    def run_cloud(self, task: Task, now: int) -> None:
        """Send a task to the cloud."""
        if self._cloud is not None:
            self._cloud.send(task, self._frames[task.id], now)

    def wake_at(self, at: int) -> None:
        """Remember a time at which the scheduler wants to be woken."""
        heapq.heappush(self._timers, at)

    def decided(self, decision: Decision, now: int) -> None:
        """Publish a decision with its reason."""
        if isinstance(decision, WakeAt):
            return
        kind = "drop" if isinstance(decision, Drop) else "cloud"
        action = "edge" if isinstance(decision, RunOnEdge) else kind
        self._note(decision.task, action, decision.reason, now)

    def closed(self, result: Result) -> None:
        """Publish a task's result, if it came in time."""
        task = result.task
        frame = self._frames.pop(task.id)
        answer = self._results.pop(task.id, None)
        in_time = result.outcome is Outcome.DONE
        origin = answer if answer is not None else frame
        self._publish(task.profile.model, origin, origin.item if answer and in_time else None)
        self._outcomes[result.outcome.value] += 1
        self._utility += result.utility
        if result.outcome is not Outcome.DROPPED:
            self._note(task, result.outcome.value, result.place.value, result.finished)

    def _publish(self, node: str, origin: Message[Any], item: Any) -> None:  # noqa: ANN401
        if item is not None or self.session.lockstep:
            self._answers[node].derive(item, origin, host_time_ns(), origin.stamp)
        if node in self._acks:
            done = ((origin.header.source, origin.header.stamp),)
            self._acks[node].derive(done, origin, host_time_ns(), origin.stamp)

    def _note(self, task: Task, action: str, reason: str, now: int) -> None:
        name = f"{task.profile.model}#{task.segment}"
        values = {"slack_ms": (task.deadline - now) / 1e6, "waited_ms": (now - task.arrival) / 1e6}
        header = Header(self._decisions.sent, now, DECISIONS)
        record = DecisionRecord(now, name, action, reason, values)
        self._decisions.measure(record, header, host_time_ns())

    def _time(self, stamp: int = 0) -> int:
        self._now = max(self._now, stamp if self.session.lockstep else self.clock.now())
        return self._now

    def _patience(self) -> float:
        if self._timers and not self.session.lockstep:
            return min(0.2, max(0.0, self.session.host_seconds(self._timers[0] - self._time())))
        return 0.2

    def _close(self) -> None:
        if self._cloud is not None:
            self._cloud.finish(_LAST_ANSWERS)

    def _values(self) -> dict[str, Any]:
        return {"outcomes": dict(self._outcomes), "utility": self._utility}
