"""E+C: the edge while it has room, the cloud for the rest."""

from __future__ import annotations

from collections.abc import Iterable

from aerodaas.schedulers.analytics.base import Decision, Task
from aerodaas.schedulers.analytics.published.edge_queue import EdgeQueue

__all__ = ["EdgeCloudEdf", "EdgeCloudSjf"]


class EdgeCloudEdf(EdgeQueue):
    """Queues a newcomer on the edge if it would make it there; looks at the newcomer only.

    `published=True` orders the edge queue by the relative deadline, as the published code does.
    """

    def __init__(self, *, published: bool = False) -> None:
        super().__init__()
        self.published = published

    def key(self, task: Task) -> float:
        """Absolute deadline, or the model's relative one."""
        return task.profile.deadline if self.published else task.deadline

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Edge if the newcomer finishes before its deadline there, else the cloud path."""
        place, finish = self.slot(task, now)
        if finish < task.deadline:
            self.insert(place, task)
            return ()
        return self.to_cloud(task, now)


class EdgeCloudSjf(EdgeCloudEdf):
    """Edge and cloud, with the shortest job first on the edge."""

    def key(self, task: Task) -> float:
        """Expected time on the edge."""
        return task.profile.edge_time
