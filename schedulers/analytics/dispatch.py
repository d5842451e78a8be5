"""The layer between a scheduler and its executors, the same in the lab and live."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Protocol

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Decision,
    Drop,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    TaskOutcome,
    TaskPlace,
    WakeAt,
)

__all__ = ["EXECUTOR_DOWN", "Dispatch", "Host"]

EXECUTOR_DOWN = "its executor on the edge is down"
"""Reason of sending or dropping a task that the scheduler wanted to run there."""


_OF_TASKS = (SendToCloud, RunOnEdge, Drop)
# Members of an enumeration are looked up slowly.
_DONE, _LATE = TaskOutcome.DONE, TaskOutcome.LATE
_EDGE, _CLOUD = TaskPlace.EDGE, TaskPlace.CLOUD


class Host(Protocol):
    """Executors and a clock: simulated ones in the lab, actors in flight.

    The host reports back through `Dispatch.finished` and `Dispatch.timer`, never from inside
    one of these calls.
    """

    def run_edge(self, task: Task, now: int) -> None:
        """Start an execution on the edge.

        Args:
            task: The task to execute.
            now: Time of the event, nanoseconds.
        """
        ...

    def run_cloud(self, task: Task, now: int) -> None:
        """Start an execution in the cloud; a slot is free.

        Args:
            task: The task to execute.
            now: Time of the event, nanoseconds.
        """
        ...

    def wake_at(self, at: int) -> None:
        """Call `Dispatch.timer` at this time."""
        ...

    def decided(self, decision: RunOnEdge | SendToCloud | Drop, now: int) -> None:
        """Take note of a decision about a task.

        Args:
            decision: The decision, with its task and reason.
            now: Time of the event, nanoseconds.
        """
        ...

    def closed(self, result: Result) -> None:
        """Take note of a task's end."""
        ...


class Dispatch:
    """Gives a scheduler its events, checks its decisions and carries them out on a host.

    Raises SchedulerError, before anything was done about it, for a decision that cannot be
    carried out: about a task that is not undecided, a second task for a busy executor, a cloud
    that does not exist, a time that has passed.
    """

    def __init__(self, scheduler: AnalyticsScheduler, resources: Resources, host: Host) -> None:
        self.resources = resources
        self.undecided: dict[int, Task] = {}
        self.running: Task | None = None
        """Task on the edge executor."""
        self.edge_open = True
        """Whether the idle edge is offered: a host that shares it closes it between its turns."""
        self.in_cloud = 0
        self.down: set[str] = set()
        """Models whose executor on the edge is down; their tasks go to the cloud or nowhere."""
        self._edge_started = 0
        self._cloud_queue: deque[SendToCloud] = deque()
        self._cloud_started: dict[int, int] = {}
        self._ended: deque[Result] = deque()
        """Ends not yet passed on to the scheduler."""
        self._has_cloud = resources.cloud_slots > 0
        self._host = host
        self._adopt(scheduler)

    def start(self, now: int) -> None:
        """Begin a run."""
        self.guarded(self.scheduler.start)(self.resources, now)

    def guarded(self, event: Callable[..., Any]) -> Callable[..., Any]:
        """The call of an event; a host that does not trust the scheduler overrides this."""
        return event

    def arrived(self, task: Task, now: int) -> None:
        """A task has reached the edge.

        Args:
            task: The task that has arrived.
            now: Time of the event, nanoseconds.
        """
        self.undecided[task.id] = task
        self._carry_out(self._task_arrived(task, now), now)
        if self.running is None:
            self._offer_edge(now)

    def timer(self, now: int) -> None:
        """A time asked for with `Host.wake_at` has come."""
        self._carry_out(self._timer(now), now)
        if self.running is None:
            self._offer_edge(now)

    def finished(self, task: Task, now: int, failure: TaskOutcome | None = None) -> None:
        """An execution has ended.

        Args:
            task: The task executed.
            now: Time of the event, nanoseconds.
            failure: TIMEOUT or FAILED; None for a result.
        """
        in_time = now <= task.deadline + task.reserve
        outcome = failure or (_DONE if in_time else _LATE)
        if task is self.running:
            self.running = None
            result = Result(task, outcome, _EDGE, self._edge_started, now)
        else:
            started = self._cloud_started.pop(task.id)
            self.in_cloud -= 1
            result = Result(task, outcome, _CLOUD, started, now)
        self._host.closed(result)
        if self._cloud_queue:
            self._fill_cloud(now)
            self._tell_ends(now)
        self._carry_out(self._task_finished(result, now), now)
        if self.running is None:
            self._offer_edge(now)

    def change_resources(self, resources: Resources, now: int) -> None:
        """Change the resources: the cloud is gone, which gives up its queue, or back.

        Args:
            resources: The resources from now on.
            now: Time of the event, nanoseconds.
        """
        self.resources = resources
        while self._cloud_queue and not resources.cloud_slots:
            self._give_up(self._cloud_queue.popleft().task, now)
        self._carry_out(self.guarded(self.scheduler.resources_changed)(resources, now), now)
        if self.running is None:
            self._offer_edge(now)

    def replace(self, scheduler: AnalyticsScheduler, now: int) -> None:
        """Go on with another scheduler, which gets the undecided tasks as new ones.

        Args:
            scheduler: The scheduler that decides from now on.
            now: Time of the event, nanoseconds.
        """
        self._adopt(scheduler)
        self._ended.clear()
        self.start(now)
        self._fill_cloud(now)
        for task in list(self.undecided.values()):
            self._carry_out(self._task_arrived(task, now), now)
        if self.running is None:
            self._offer_edge(now)

    def offer(self, now: int) -> None:
        """The edge is open: tasks that wait for it may start."""
        if self.running is None:
            self._offer_edge(now)

    def _adopt(self, scheduler: AnalyticsScheduler) -> None:
        # Events come by the million in the lab, so each is looked up and guarded once.
        self.scheduler = scheduler
        self._task_arrived = self.guarded(scheduler.task_arrived)
        self._executor_idle = self.guarded(scheduler.executor_idle)
        self._task_finished = self.guarded(scheduler.task_finished)
        self._timer = self.guarded(scheduler.timer)

    def _offer_edge(self, now: int) -> None:
        undecided = self.undecided
        while self.edge_open and undecided and self.running is None:
            before = len(undecided)
            self._carry_out(self._executor_idle(now), now)
            if len(undecided) == before:
                return

    def _carry_out(self, decisions: Iterable[Decision] | None, now: int) -> None:
        self._obey(decisions, now)
        if self._ended:
            self._tell_ends(now)

    def _obey(self, decisions: Iterable[Decision] | None, now: int) -> None:
        if decisions is None:
            name = type(self.scheduler).__name__
            raise SchedulerError(
                f"{name} answered an event with None; return a list of decisions, or yield them"
            )
        for decision in decisions:
            if isinstance(decision, WakeAt):
                # Said so that NaN, which no timer would ever reach, is refused, too.
                if not now <= decision.at:
                    raise self._refusal(decision, f"it lies in the past, now is {now}")
                self._host.wake_at(decision.at)
                continue
            if not isinstance(decision, _OF_TASKS):
                raise self._refusal(decision, "that is none of the decisions of the protocol")
            task = decision.task
            if self.undecided.get(task.id) is not task:
                raise self._refusal(decision, "the task never arrived or was decided before")
            if not isinstance(decision.reason, str):
                raise self._refusal(decision, f"its reason {decision.reason!r} is no text")
            if isinstance(decision, SendToCloud):
                self._send(decision, now)
            elif isinstance(decision, RunOnEdge):
                self._run_edge(decision, now)
            else:
                del self.undecided[task.id]
                self._host.decided(decision, now)
                self._host.closed(Result(task, TaskOutcome.DROPPED, TaskPlace.NOWHERE, now, now))

    def _run_edge(self, decision: RunOnEdge, now: int) -> None:
        task = decision.task
        if self.running is not None:
            raise self._refusal(decision, f"the edge executor is busy with task {self.running.id}")
        if task.profile.model in self.down:
            self._divert(task, now)
            return
        del self.undecided[task.id]
        self.running = task
        self._edge_started = now
        self._host.decided(decision, now)
        self._host.run_edge(task, now)

    def _divert(self, task: Task, now: int) -> None:
        """Send the tasks of an executor that is down to the cloud, if they pay and fit."""
        profile = task.profile
        latest = task.deadline - profile.cloud_time
        if self.resources.cloud_slots and profile.cloud_gain > 0 and now <= latest:
            self._send(SendToCloud(task, EXECUTOR_DOWN, latest), now)
        else:
            del self.undecided[task.id]
            self._host.decided(Drop(task, EXECUTOR_DOWN), now)
            self._give_up(task, now)

    def _send(self, decision: SendToCloud, now: int) -> None:
        if not self._has_cloud:
            raise self._refusal(decision, "there is no cloud")
        task = decision.task
        del self.undecided[task.id]
        self._host.decided(decision, now)
        if not self.resources.cloud_slots:
            self._give_up(task, now)
        elif self.in_cloud < self.resources.cloud_slots:
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
                self._give_up(waiting.task, now)

    def _give_up(self, task: Task, now: int) -> None:
        """End a task that the scheduler takes for started; the scheduler learns it at once."""
        result = Result(task, TaskOutcome.DROPPED, TaskPlace.NOWHERE, now, now)
        self._host.closed(result)
        self._ended.append(result)

    def _tell_ends(self, now: int) -> None:
        while self._ended:
            result = self._ended.popleft()
            self._obey(self._task_finished(result, now), now)

    def _refusal(self, decision: object, why: str) -> SchedulerError:
        name = type(self.scheduler).__name__
        task = getattr(decision, "task", None)
        what = f"{type(decision).__name__} of task {task.id}" if task else repr(decision)
        return SchedulerError(f"{name} decided {what}: {why}")
