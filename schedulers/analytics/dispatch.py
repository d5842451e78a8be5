"""What stands between a scheduler and its executors, the same in the lab and live."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Protocol

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Decision,
    Drop,
    Outcome,
    Place,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    WakeAt,
)

__all__ = ["Dispatch", "Host"]


class Host(Protocol):
    """Executors and a clock: simulated ones in the lab, actors in flight.

    The host reports back through `Dispatch.finished` and `Dispatch.timer`, never from inside
    one of these calls.
    """

    def run_edge(self, task: Task, now: int) -> None:
        """Start an execution on the edge."""
        ...

    def run_cloud(self, task: Task, now: int) -> None:
        """Start an execution in the cloud; a slot is free."""
        ...

    def wake_at(self, at: int) -> None:
        """Call `Dispatch.timer` at this time."""
        ...

    def decided(self, decision: Decision, now: int) -> None:
        """Take note of a decision about a task."""
        ...

    def closed(self, result: Result) -> None:
        """Take note of a task's end."""
        ...


class Dispatch:
    """Tells a scheduler the events, checks its decisions and carries them out on a host.

    Raises SchedulerError, before anything was done about it, for a decision that cannot be
    carried out: about a task that is not undecided, a second task for a busy executor, a cloud
    that does not exist, a time that has passed.
    """

    def __init__(self, scheduler: AnalyticsScheduler, resources: Resources, host: Host) -> None:
        self.scheduler = scheduler
        self.resources = resources
        self.undecided: dict[int, Task] = {}
        self.running: Task | None = None
        """Task on the edge executor."""
        self.in_cloud = 0
        self._edge_started = 0
        self._cloud_queue: deque[SendToCloud] = deque()
        self._cloud_started: dict[int, int] = {}
        self._host = host

    @property
    def cloud_waiting(self) -> int:
        """Tasks sent to the cloud that no slot has taken yet."""
        return len(self._cloud_queue)

    def start(self, now: int) -> None:
        """Begin a run."""
        self.scheduler.start(self.resources, now)

    def arrived(self, task: Task, now: int) -> None:
        """A task has reached the edge."""
        self.undecided[task.id] = task
        self._carry_out(self.scheduler.task_arrived(task, now), now)
        if self.running is None:
            self._offer_edge(now)

    def timer(self, now: int) -> None:
        """A time asked for with `Host.wake_at` has come."""
        self._carry_out(self.scheduler.timer(now), now)
        if self.running is None:
            self._offer_edge(now)

    def finished(self, task: Task, now: int, failure: Outcome | None = None) -> None:
        """An execution has ended: with a result, or with TIMEOUT or FAILED as its `failure`."""
        outcome = failure or (Outcome.DONE if now <= task.deadline else Outcome.LATE)
        if task is self.running:
            self.running = None
            result = Result(task, outcome, Place.EDGE, self._edge_started, now)
        else:
            started = self._cloud_started.pop(task.id)
            self.in_cloud -= 1
            result = Result(task, outcome, Place.CLOUD, started, now)
            if self._cloud_queue:
                self._fill_cloud(now)
        self._close(result, now)
        if self.running is None:
            self._offer_edge(now)

    def replace(self, scheduler: AnalyticsScheduler, now: int) -> None:
        """Go on with another scheduler, which is told of the undecided tasks as new ones."""
        self.scheduler = scheduler
        self.start(now)
        for task in list(self.undecided.values()):
            self._carry_out(scheduler.task_arrived(task, now), now)
        if self.running is None:
            self._offer_edge(now)

    def _offer_edge(self, now: int) -> None:
        undecided = self.undecided
        while undecided and self.running is None:
            before = len(undecided)
            self._carry_out(self.scheduler.executor_idle(now), now)
            if len(undecided) == before:
                return

    def _carry_out(self, decisions: Iterable[Decision], now: int) -> None:
        for decision in decisions:
            if isinstance(decision, WakeAt):
                if decision.at < now:
                    raise self._refusal(decision, f"it lies in the past, now is {now}")
                self._host.wake_at(decision.at)
                continue
            if not isinstance(decision, (RunOnEdge, SendToCloud, Drop)):
                raise self._refusal(decision, "that is none of the decisions of the protocol")
            task = decision.task
            if self.undecided.get(task.id) is not task:
                raise self._refusal(decision, "the task never arrived or was decided before")
            if isinstance(decision, RunOnEdge):
                self._run_edge(decision, now)
            elif isinstance(decision, SendToCloud):
                self._send(decision, now)
            else:
                del self.undecided[task.id]
                self._host.decided(decision, now)
                self._host.closed(Result(task, Outcome.DROPPED, Place.NOWHERE, now, now))

    def _run_edge(self, decision: RunOnEdge, now: int) -> None:
        task = decision.task
        if self.running is not None:
            raise self._refusal(decision, f"the edge executor is busy with task {self.running.id}")
        del self.undecided[task.id]
        self.running = task
        self._edge_started = now
        self._host.decided(decision, now)
        self._host.run_edge(task, now)

    def _send(self, decision: SendToCloud, now: int) -> None:
        if not self.resources.cloud_slots:
            raise self._refusal(decision, "there is no cloud")
        task = decision.task
        del self.undecided[task.id]
        self._host.decided(decision, now)
        if self.in_cloud < self.resources.cloud_slots:
            self._start_cloud(task, now)
        else:
            self._cloud_queue.append(decision)

    def _start_cloud(self, task: Task, now: int) -> None:
        self.in_cloud += 1
        self._cloud_started[task.id] = now
        self._host.run_cloud(task, now)

    def _fill_cloud(self, now: int) -> None:
        queue = self._cloud_queue
        while queue and self.in_cloud < self.resources.cloud_slots:
            waiting = queue.popleft()
            if waiting.latest_start is None or now <= waiting.latest_start:
                self._start_cloud(waiting.task, now)
            else:
                self._close(Result(waiting.task, Outcome.DROPPED, Place.NOWHERE, now, now), now)

    def _close(self, result: Result, now: int) -> None:
        self._host.closed(result)
        self._carry_out(self.scheduler.task_finished(result, now), now)

    def _refusal(self, decision: object, why: str) -> SchedulerError:
        name = type(self.scheduler).__name__
        task = getattr(decision, "task", None)
        what = f"{type(decision).__name__} of task {task.id}" if task else repr(decision)
        return SchedulerError(f"{name} decided {what}: {why}")
