"""Base of the published schedulers: an ordered queue before the serial edge executor."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable

from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Decision,
    Drop,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
)

__all__ = ["EdgeQueue"]


class EdgeQueue(AnalyticsScheduler):
    """Tasks ordered by `key`, each start checked just in time against its expected time.

    Ties keep the order of arrival. By itself it admits everything (edge only). Subclasses change
    the queue by `insert` and `remove` only, which keep what is looked up with each arrival.
    """

    def __init__(self) -> None:
        self.queue: list[Task] = []
        self.free_at = 0
        """When the running task is expected to end."""
        self._keys: list[float] | None = None
        """Of the queue's tasks, from the first newcomer on that is offered a slot."""
        self._lengths: list[int] = []
        """How long each of them will occupy the edge, likewise."""

    def key(self, task: Task) -> float:
        """Order of the queue, the smallest first."""
        return task.deadline

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:  # noqa: ARG002
        """Queue the task."""
        self.insert(bisect_right(self.queue, self.key(task), key=self.key), task)
        return ()

    def executor_idle(self, now: int) -> Iterable[Decision]:
        """Start the first task that fits in its slack; drop those before it."""
        queue = self.queue
        decisions: list[Decision] = []
        while queue:
            task = self.remove(0)
            if now + task.profile.edge_time <= self.due(task):
                decisions.append(self.run(task, now))
                break
            decisions.append(self.drop(task, now, "no time left on the edge"))
        return decisions

    def insert(self, place: int, task: Task) -> None:
        """Put `task` into the queue.

        Args:
            place: Place in the queue, from 0; the task that has it comes next.
            task: The task to queue.
        """
        self.queue.insert(place, task)
        if self._keys is not None:
            self._keys.insert(place, self.key(task))
            self._lengths.insert(place, self.occupied(task))

    def remove(self, place: int) -> Task:
        """Take the task of this place out of the queue."""
        if self._keys is not None:
            del self._keys[place], self._lengths[place]
        return self.queue.pop(place)

    def run(self, task: Task, now: int, reason: str = "first in the edge queue") -> RunOnEdge:
        """Start `task`, expected to take its profile's time.

        Args:
            task: The task to start.
            now: Time of the event, nanoseconds.
            reason: Why, for the decision.
        """
        self.free_at = now + task.profile.edge_time
        return RunOnEdge(task, reason)

    def drop(self, task: Task, now: int, reason: str) -> Drop:  # noqa: ARG002 - for overriding
        """Give `task` up; the one place that GEMS and DEMS-A watch.

        Args:
            task: The task to give up.
            now: Time of the event, nanoseconds.
            reason: Why, for the decision.
        """
        return Drop(task, reason)

    def due(self, task: Task) -> int:
        """The deadline that starts are checked against."""
        return task.deadline

    def cloud_time(self, task: Task) -> int:
        """Expected time of `task` in the cloud."""
        return task.profile.cloud_time

    def send(self, task: Task, reason: str) -> SendToCloud:
        """Send `task` to the cloud, where it starts only while its expected time fits.

        Args:
            task: The task to send.
            reason: Why, for the decision.
        """
        return SendToCloud(task, reason, self.due(task) - self.cloud_time(task))

    def to_cloud(
        self, task: Task, now: int, reason: str = "no room on the edge"
    ) -> Iterable[Decision]:
        """The cloud path: the cloud if it pays and fits in the slack, else drop.

        Args:
            task: The task that the edge does not run.
            now: Time of the event, nanoseconds.
            reason: Why, for the decision.
        """
        if task.profile.cloud_gain <= 0:
            return [self.drop(task, now, "the cloud costs more than the result is worth")]
        if not self.resources.cloud_slots or now + self.cloud_time(task) > task.deadline:
            return [self.drop(task, now, "no time left for the cloud")]
        return [self.send(task, reason)]

    def occupied(self, task: Task) -> int:
        """Time after which the edge can begin the task behind `task` in the queue."""
        return task.profile.edge_time

    def slot(self, task: Task, now: int) -> tuple[int, int]:
        """Place of a newcomer in the queue, from 0, and when it would finish there, nanoseconds.

        Args:
            task: The task that has arrived.
            now: Time of the event, nanoseconds.
        """
        if self._keys is None:
            self._keys = [self.key(other) for other in self.queue]
            self._lengths = [self.occupied(other) for other in self.queue]
        place = bisect_right(self._keys, self.key(task))
        begin = max(self.free_at, now)
        return place, begin + sum(self._lengths[:place]) + self.occupied(task)

    def measure_queue(self) -> None:
        """Reckon anew how long the queue's tasks will occupy the edge, whose share changed."""
        self._lengths = [self.occupied(task) for task in self.queue]

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
        """The edge is free as soon as its task is back."""
        if result.started + result.task.profile.edge_time == self.free_at:
            self.free_at = now
        return ()
