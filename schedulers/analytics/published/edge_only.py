"""Edge-only schedulers: one queue, six orders, no cloud."""

from __future__ import annotations

from aerodaas.schedulers.analytics.base import Task
from aerodaas.schedulers.analytics.published.edge_queue import EdgeQueue

__all__ = ["Edf", "Fifo", "Hbf", "Hpf", "Huf", "Sjf"]


class Fifo(EdgeQueue):
    """First in, first out."""

    def key(self, task: Task) -> float:
        """Order of arrival."""
        return task.arrival


class Edf(EdgeQueue):
    """Earliest deadline first: optimal on one machine while every task can be met.

    `published=True` orders by the relative deadline instead (deadline-monotonic), as the
    published code does.
    """

    def __init__(self, *, published: bool = False) -> None:
        super().__init__()
        self.published = published

    def key(self, task: Task) -> float:
        """Absolute deadline, or the model's relative one."""
        return task.profile.deadline if self.published else task.deadline


class Sjf(EdgeQueue):
    """Shortest job first."""

    def key(self, task: Task) -> float:
        """Expected time on the edge."""
        return task.profile.edge_time


class Hbf(EdgeQueue):
    """Highest benefit first."""

    def key(self, task: Task) -> float:
        """Benefit, descending."""
        return -task.profile.benefit


class Huf(EdgeQueue):
    """Highest utility first."""

    def key(self, task: Task) -> float:
        """Gain on the edge, descending."""
        return -task.profile.edge_gain


class Hpf(EdgeQueue):
    """Highest payoff first: gain per time."""

    def key(self, task: Task) -> float:
        """Gain on the edge per nanosecond, descending."""
        return -task.profile.edge_gain / task.profile.edge_time
