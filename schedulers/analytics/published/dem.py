"""DEM: E+C with migration of the tasks that a newcomer pushes past their deadlines."""

from __future__ import annotations

from collections.abc import Iterable

from aerodaas.schedulers.analytics.base import MIGRATED, Decision, Task
from aerodaas.schedulers.analytics.published.edge_cloud import EdgeCloudEdf

__all__ = ["Dem"]


class Dem(EdgeCloudEdf):
    """Inserts a newcomer if its gain exceeds its victims' loss by leaving the edge.

    Victims are the tasks behind the newcomer's slot that would miss their deadline once it is
    inserted. `published=True` never looks at the first task behind the slot and orders by the
    relative deadline, as the published code does.
    """

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Insert, insert and migrate the victims, or send the newcomer down the cloud path."""
        place, finish = self.slot(task, now)
        if finish >= task.deadline:
            return self.to_cloud(task, now)
        victims = self._victims(place, finish)
        if victims and sum(self.loss(v, now) for v in victims) >= self.loss(task, now):
            return self.to_cloud(task, now)
        self.insert(place, task)
        decisions: list[Decision] = []
        for victim in victims:
            self.remove(self.queue.index(victim))
            decisions.extend(self.to_cloud(victim, now, MIGRATED))
        return decisions

    def loss(self, task: Task, now: int) -> float:
        """Utility that `task` loses off the edge: the difference to the cloud, or all of it.

        Args:
            task: A task that may leave the edge's queue.
            now: Time of the event, nanoseconds.
        """
        profile = task.profile
        if now + self.cloud_time(task) < task.deadline and profile.cloud_gain >= 0:
            return abs(profile.edge_gain - profile.cloud_gain)
        return profile.edge_gain

    def _victims(self, place: int, finish: int) -> list[Task]:
        victims = []
        lengths = self._lengths[place:]
        for index, (other, length) in enumerate(zip(self.queue[place:], lengths, strict=True)):
            finish += length
            if finish > other.deadline and not (self.published and index == 0):
                victims.append(other)
        return victims
