"""CLD: everything to the cloud."""

from __future__ import annotations

from collections.abc import Iterable

from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Decision, Drop, SendToCloud, Task

__all__ = ["CloudOnly"]


class CloudOnly(AnalyticsScheduler):
    """Sends each task that pays in the cloud and drops the others."""

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Send or drop at once."""
        latest = task.deadline - task.profile.cloud_time
        if task.profile.cloud_gain <= 0 or not self.resources.cloud_slots:
            return [Drop(task, "the cloud costs more than the result is worth")]
        if now > latest:
            return [Drop(task, "no time left for the cloud")]
        return [SendToCloud(task, "cloud only", latest)]
