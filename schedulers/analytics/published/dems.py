"""DEMS: DEM whose idle edge steals work back from tasks that wait to leave for the cloud."""

from __future__ import annotations

from collections.abc import Iterable
from heapq import heappop, heappush
from itertools import accumulate

from aerodaas.schedulers.analytics.base import MILLISECOND, STOLEN, Decision, Task, WakeAt
from aerodaas.schedulers.analytics.published.dem import Dem

__all__ = ["Dems"]

MARGIN = 10 * MILLISECOND
"""Taken off a task's latest start, for the scheduler's own overhead."""
PUBLISHED_GATE = 132 * MILLISECOND
"""Room before the head's latest start that the published code wants before it steals."""


class Dems(Dem):
    """Lets cloud-bound tasks wait until their latest start, so that the edge may steal them.

    Tasks that lose money in the cloud wait as well, only to be stolen. When the edge is idle, the
    tasks that wait are tried by gain over the cloud per edge time, those that lose money in the
    cloud first; the first that fits without making a queued task miss is run.

    `published=True`: as in the published code, a constant of 132 ms gates stealing and a
    candidate that does not fit inherits the rank of the one before it.
    """

    def __init__(self, *, published: bool = False) -> None:
        super().__init__(published=published)
        self.tentative: dict[Task, str] = {}
        """Tasks waiting to leave, and why they are bound for the cloud."""
        self._leaves: list[tuple[int, int, Task]] = []
        """Latest start of each task that has waited, a heap with numbers in order of waiting; the
        entries of stolen tasks are stale."""
        self._waited = 0

    def to_cloud(
        self, task: Task, now: int, reason: str = "no room on the edge"
    ) -> Iterable[Decision]:
        """Let the task wait until its latest start in the cloud, or on the edge."""
        profile = task.profile
        pays = profile.cloud_gain > 0 and self.resources.cloud_slots > 0
        takes = self.cloud_time(task) if pays else profile.edge_time
        if pays and now + takes > task.deadline:
            return [self.drop(task, now, "no time left for the cloud")]
        leave = task.deadline - MARGIN - takes
        if leave <= now:
            return [self._reject(task, now, reason)]
        self.tentative[task] = reason
        heappush(self._leaves, (leave, self._waited, task))
        self._waited += 1
        return [WakeAt(leave)]

    def _reject(self, task: Task, now: int, reason: str) -> Decision:
        """The task can wait no longer."""
        if task.profile.cloud_gain > 0 and self.resources.cloud_slots:
            return self.send(task, reason)
        return self.drop(task, now, "not stolen, and the cloud costs more than it is worth")

    def timer(self, now: int) -> Iterable[Decision]:
        """Send or drop the tasks whose latest start has come."""
        leaves, tentative = self._leaves, self.tentative
        due: list[tuple[int, Task]] = []
        while leaves and leaves[0][0] <= now:
            _, number, task = heappop(leaves)
            if task in tentative:
                due.append((number, task))
        due.sort()
        return [self._reject(task, now, tentative.pop(task)) for _, task in due]

    def executor_idle(self, now: int) -> Iterable[Decision]:
        """Steal a task that fits before the queue, else run the queue's head."""
        stolen = self._steal(now)
        if stolen is None:
            return super().executor_idle(now)
        del self.tentative[stolen]
        return [self.run(stolen, now, STOLEN)]

    def _steal(self, now: int) -> Task | None:
        room = self._room(now)
        if self.published and self.queue:
            if room < PUBLISHED_GATE:
                return None
            return self._steal_as_published(now, room)
        fitting = [
            task
            for task in self.tentative
            if (takes := task.profile.edge_time) <= room and now + takes <= task.deadline
        ]
        return min(fitting, key=_rank, default=None)

    def _steal_as_published(self, now: int, room: int) -> Task | None:
        best: Task | None = None
        best_rank = rank = (False, 0.0)
        for task in self.tentative:
            profile = task.profile
            if profile.edge_time <= room and now + profile.edge_time <= task.deadline:
                rank = (profile.cloud_gain < 0, -_rank(task)[1])
            if rank > best_rank:
                best, best_rank = task, rank
        return best

    def _room(self, now: int) -> int:
        """Time that can be put before the queue without making a task in it miss."""
        ends = accumulate(self._lengths, initial=now)
        next(ends)
        spares = [task.deadline - end for task, end in zip(self.queue, ends, strict=True)]
        return min([spare for spare in spares if spare >= 0], default=1 << 62)


def _rank(task: Task) -> tuple[bool, float]:
    """Tasks that lose money in the cloud first, then by gain over the cloud per edge time."""
    profile = task.profile
    advantage = (profile.edge_gain - profile.cloud_gain) / profile.edge_time
    return (profile.cloud_gain > 0, -advantage)
