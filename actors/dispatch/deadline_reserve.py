"""Overhead of the live system per execution: the round trip to an executor, and late timers."""

from __future__ import annotations

from collections import deque

from aerodaas.schedulers.analytics.base import MILLISECOND
from aerodaas.types.status import Message

__all__ = ["DeadlineReserve"]

_KEPT = 200
_ENOUGH = 20
"""Samples needed before a measurement counts."""
_AT_FIRST = 5 * MILLISECOND
_QUANTILE = 0.95
_LARGEST_SHARE = 0.1
"""Of a task's deadline that may be held in reserve."""


class DeadlineReserve:
    """Measures overheads outside the scheduler's model; the same reserve for each scheduler.

    A table of execution times and a simulator know nothing of messages and thread switches. A
    scheduler that defers to the last moment would miss by them, so each task's deadline is moved
    forward by a high quantile of what they took of late; results are judged by the true one.
    """

    def __init__(self) -> None:
        self._ways: deque[int] = deque(maxlen=_KEPT)
        self._delays: deque[int] = deque(maxlen=_KEPT)
        self._reserve = _AT_FIRST
        self._news = 0

    def travelled(self, answer: Message[object], taken: int) -> None:
        """Record an execution on the edge of duration `taken`; its executor's span is the work."""
        work = answer.spans[-1].published - answer.spans[-1].received
        self._ways.append(max(0, taken - work))
        self._refresh()

    def delayed(self, late: int) -> None:
        """A timer came `late`."""
        self._delays.append(max(0, late))
        self._refresh()

    def reserve(self, deadline: int) -> int:
        """Time to subtract from a relative deadline, nanoseconds."""
        return min(self._reserve, int(_LARGEST_SHARE * deadline))

    def _refresh(self) -> None:
        self._news += 1
        if self._news >= _ENOUGH and len(self._ways) >= _ENOUGH:
            self._news = 0
            self._reserve = _high(self._ways) + _high(self._delays)


def _high(samples: deque[int]) -> int:
    return sorted(samples)[int(_QUANTILE * (len(samples) - 1))] if samples else 0
