"""The Kalmia variant (SOTA 1 of the published evaluation): urgency instead of cost."""

from __future__ import annotations

from collections.abc import Iterable

from aerodaas.schedulers.analytics.base import Decision, Result, Task
from aerodaas.schedulers.analytics.published.edge_only import Fifo

__all__ = ["Kalmia"]

EXTENSION = 0.1
"""Share of the relative deadline that is granted to models that are not urgent."""


class Kalmia(Fifo):
    """FIFO on the edge if the newcomer makes it, else the cloud if it fits, at any cost.

    A model that is not urgent is tried once more with its deadline extended by 10 %; urgent ones
    are dropped. The lab judges by the original deadline, so an extension pays only where times
    turn out shorter than expected.
    """

    def __init__(self) -> None:
        super().__init__()
        self._extended: dict[Task, int] = {}

    def due(self, task: Task) -> int:
        """The deadline, extended where that was granted."""
        return self._extended.get(task, task.deadline)

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Edge, cloud, the same with an extension, or drop."""
        decisions = self._place(task, now)
        if decisions is None and not task.profile.urgent:
            self._extended[task] = task.deadline + int(EXTENSION * task.profile.deadline)
            decisions = self._place(task, now)
        if decisions is None:
            self._extended.pop(task, None)
            return [self.drop(task, now, "no time left on the edge or in the cloud")]
        return decisions

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
        """Forget the task's extension."""
        self._extended.pop(result.task, None)
        return super().task_finished(result, now)

    def _place(self, task: Task, now: int) -> list[Decision] | None:
        place, finish = self.slot(task, now)
        if finish < self.due(task):
            self.insert(place, task)
            return []
        if self.resources.cloud_slots and now + self.cloud_time(task) < self.due(task):
            return [self.send(task, "no room on the edge")]
        return None
