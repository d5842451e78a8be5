"""GEMS: DEMS-A that rescues the models whose quality of experience is in danger."""

from __future__ import annotations

from collections.abc import Iterable

from aerodaas.schedulers.analytics.base import (
    MIGRATED,
    Decision,
    Drop,
    QoeGoal,
    Result,
    Task,
    TaskOutcome,
)
from aerodaas.schedulers.analytics.published.dems_a import DemsA

__all__ = ["Gems"]

_NO_GOAL = QoeGoal(0.0)


class Gems(DemsA):
    """Counts each model's tasks in time over those that ended, per window of its QoE goal.

    After every finish or drop, the tasks of each model below its share that wait for the edge go
    to the cloud at once, if they pay and fit there. `published=True`: no adaptation of the cloud
    times, no stealing on an empty queue, and newcomers that lose money in the cloud are dropped
    at once, as in the published code.
    """

    def __init__(self, *, published: bool = False) -> None:
        super().__init__(published=published)
        self.adapts = not published
        self._counts: dict[str, list[int]] = {}
        """Per model: number of the window, tasks in time, tasks ended."""
        self._below: dict[str, int] = {}
        """Models below their share when one of their tasks last ended, and the window of that."""
        self._changed = False

    def drop(self, task: Task, now: int, reason: str) -> Drop:
        """Count a drop."""
        self._count(task, now, done=False)
        return super().drop(task, now, reason)

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """As DEMS-A, then rescue."""
        return self._and_rescue(super().task_arrived(task, now), now)

    def executor_idle(self, now: int) -> Iterable[Decision]:
        """As DEMS, then rescue."""
        return self._and_rescue(super().executor_idle(now), now)

    def timer(self, now: int) -> Iterable[Decision]:
        """As DEMS, then rescue."""
        return self._and_rescue(super().timer(now), now)

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
        """Count the end, learn as DEMS-A unless as published, then rescue."""
        self._count(result.task, now, done=result.outcome is TaskOutcome.DONE)
        return self._and_rescue(super().task_finished(result, now), now)

    def to_cloud(
        self, task: Task, now: int, reason: str = "no room on the edge"
    ) -> Iterable[Decision]:
        """As DEMS-A; as published, tasks that lose money in the cloud never wait."""
        if self.published and task.profile.cloud_gain < 0:
            return [self.drop(task, now, "the cloud costs more than the result is worth")]
        return super().to_cloud(task, now, reason)

    def _steal(self, now: int) -> Task | None:
        return None if self.published and not self.queue else super()._steal(now)

    def _count(self, task: Task, now: int, *, done: bool) -> None:
        profile = task.profile
        goal = profile.qoe or _NO_GOAL
        window = now // goal.window
        counts = self._counts.get(profile.model)
        if counts is None or counts[0] != window:
            counts = self._counts[profile.model] = [window, 0, 0]
        counts[1] += done
        counts[2] += 1
        if counts[1] < goal.share * counts[2]:
            self._below[profile.model] = window
        else:
            self._below.pop(profile.model, None)
        self._changed = True

    def _and_rescue(self, decisions: Iterable[Decision], now: int) -> Iterable[Decision]:
        if not self._changed:
            return decisions
        found = list(decisions)
        while self._changed:
            self._changed = False
            for task in [task for task in self.queue if self._in_danger(task, now)]:
                self.remove(self.queue.index(task))
                found.append(self.send(task, MIGRATED))
        return found

    def _in_danger(self, task: Task, now: int) -> bool:
        profile = task.profile
        if profile.qoe is None or self._below.get(profile.model) != now // profile.qoe.window:
            return False
        if profile.cloud_gain <= 0 or not self.resources.cloud_slots:
            return False
        return now + self.cloud_time(task) < task.deadline
