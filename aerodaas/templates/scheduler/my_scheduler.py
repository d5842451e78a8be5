"""An analytics scheduler of your own: which task runs on the edge, which in the cloud."""

from collections.abc import Iterator

from aerodaas.schedulers.analytics import (
    AnalyticsScheduler,
    Decision,
    Drop,
    RunOnEdge,
    SendToCloud,
    Task,
    WakeAt,
)

SPARE = 50_000_000
"""Nanoseconds between a cloud task's expected end and its deadline."""


class MyScheduler(AnalyticsScheduler):
    """The most valuable task on the edge; the cloud for those that can wait no longer."""

    def __init__(self) -> None:
        """Begin with nothing waiting."""
        self.waiting: list[Task] = []

    def task_arrived(self, task: Task, now: int) -> Iterator[Decision]:
        """Let it wait for the edge until it must leave for the cloud."""
        self.waiting.append(task)
        yield WakeAt(max(self._leaves(task), now))

    def timer(self, now: int) -> Iterator[Decision]:
        """Send away what can wait no longer."""
        for task in [task for task in self.waiting if now >= self._leaves(task)]:
            self.waiting.remove(task)
            if task.profile.cloud_gain > 0 and self.resources.cloud_slots:
                yield SendToCloud(task, "no longer worth waiting for the edge")
            else:
                yield Drop(task, "does not pay in the cloud")

    def executor_idle(self, now: int) -> Iterator[Decision]:
        """Run the task that gains most for the edge's time, of those that finish in time."""
        fitting = [task for task in self.waiting if now + task.profile.edge_time <= task.deadline]
        if fitting:
            best = max(fitting, key=lambda task: task.profile.edge_gain / task.profile.edge_time)
            self.waiting.remove(best)
            yield RunOnEdge(best, "highest gain per time")

    @staticmethod
    def _leaves(task: Task) -> int:
        return task.deadline - task.profile.cloud_time - SPARE
