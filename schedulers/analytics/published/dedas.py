"""Dedas (SOTA 2 of the published evaluation): mean completion time instead of cost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from aerodaas.schedulers.analytics.base import MIGRATED, Decision, Task
from aerodaas.schedulers.analytics.published.edge_only import Sjf

__all__ = ["Dedas"]


class Dedas(Sjf):
    """Shortest job first on the edge; a newcomer may evict one task, and only to gain time.

    With more than one victim the newcomer goes to the cloud. A single victim is evicted only if
    the mean completion time of the edge queue falls. Costs are ignored.
    """

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Insert, swap for one victim, or send to the cloud."""
        place, finish = self.slot(task, now)
        if finish >= task.deadline:
            return self.to_cloud(task, now)
        victims = []
        for other in self.queue[place:]:
            finish += other.profile.edge_time
            if finish > other.deadline:
                victims.append(other)
        if not victims:
            self.insert(place, task)
            return ()
        inserted = [*self.queue[:place], task, *self.queue[place:]]
        inserted.remove(victims[0])
        if len(victims) > 1 or _total_completion(inserted) >= _total_completion(self.queue):
            return self.to_cloud(task, now)
        self.insert(place, task)
        self.remove(self.queue.index(victims[0]))
        return self.to_cloud(victims[0], now, MIGRATED)

    def to_cloud(
        self, task: Task, now: int, reason: str = "no room on the edge"
    ) -> Iterable[Decision]:
        """The cloud if the task fits in its slack there, at any cost, else drop."""
        if not self.resources.cloud_slots or now + self.cloud_time(task) > task.deadline:
            return [self.drop(task, now, "no time left for the cloud")]
        return [self.send(task, reason)]


def _total_completion(queue: Sequence[Task]) -> int:
    """Sum of the completion times; the queues compared are of one length, so it ranks means."""
    finish = total = 0
    for task in queue:
        finish += task.profile.edge_time
        total += finish
    return total
