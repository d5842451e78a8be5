"""Analytics schedulers that go wrong in flight, each in its own way."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from aerodaas.schedulers.analytics.base import Decision, RunOnEdge, Task
from aerodaas.schedulers.analytics.published.edge_only import Fifo

__all__ = ["Forgetful", "Hanging", "Raising", "Silent", "Slow", "Twice"]

_GOOD = 5
"""Arrivals before the fault shows."""


class _Faulty(Fifo):
    """First in, first out, until the fault shows at the sixth arrival."""

    def __init__(self) -> None:
        super().__init__()
        self.arrivals = 0

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Count, and go wrong at the sixth."""
        self.arrivals += 1
        if self.arrivals > _GOOD:
            decisions: Iterable[Decision] = self._go_wrong(task, now)
            return decisions
        return super().task_arrived(task, now)

    def _go_wrong(self, task: Task, now: int) -> Any:  # noqa: ANN401
        raise NotImplementedError


class Raising(_Faulty):
    """Has a bug."""

    def _go_wrong(self, task: Task, now: int) -> Any:  # noqa: ANN401, ARG002
        raise ZeroDivisionError("a bug of the user's own")


class Silent(_Faulty):
    """Forgets to return its decisions."""

    def _go_wrong(self, task: Task, now: int) -> Any:  # noqa: ANN401, ARG002
        return None


class Twice(_Faulty):
    """Runs a task that it has run before."""

    def executor_idle(self, now: int) -> Iterable[Decision]:
        """Remember what is run."""
        for decision in super().executor_idle(now):
            self.last = decision
            yield decision

    def _go_wrong(self, task: Task, now: int) -> Any:  # noqa: ANN401, ARG002
        assert isinstance(self.last, RunOnEdge)
        return [self.last]


class Forgetful(_Faulty):
    """Loses a task."""

    def _go_wrong(self, task: Task, now: int) -> Any:  # noqa: ANN401, ARG002
        return ()


class Slow(_Faulty):
    """Thinks for long, every time."""

    def _go_wrong(self, task: Task, now: int) -> Any:  # noqa: ANN401
        time.sleep(0.08)
        return super(_Faulty, self).task_arrived(task, now)

    def executor_idle(self, now: int) -> Iterable[Decision]:
        """As first in, first out, after a while."""
        if self.arrivals > _GOOD:
            time.sleep(0.08)
        return super().executor_idle(now)

    def task_finished(self, result: Any, now: int) -> Iterable[Decision]:  # noqa: ANN401
        """As first in, first out, after a while."""
        if self.arrivals > _GOOD:
            time.sleep(0.08)
        return super().task_finished(result, now)


class Hanging(_Faulty):
    """Never comes to an end."""

    def _go_wrong(self, task: Task, now: int) -> Any:  # noqa: ANN401, ARG002
        while True:
            pass
