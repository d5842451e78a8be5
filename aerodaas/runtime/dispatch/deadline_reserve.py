"""Reserve for the live system's overhead: round trips to an executor, and late timers."""

from __future__ import annotations

from collections import deque

from aerodaas.messages.envelope import Message
from aerodaas.schedulers.analytics.base import MILLISECOND

__all__ = ["DeadlineReserve"]

_KEPT = 200
_ENOUGH = 20
"""Samples before the measurements are used."""
_AT_FIRST = 5 * MILLISECOND
_QUANTILE = 0.95
_LARGEST_SHARE = 0.1
"""Largest fraction of a task's deadline held in reserve."""


class DeadlineReserve:
    """Measured overhead, by which the deadlines given to every scheduler are shortened.

    Tables of execution times and simulators do not include messages and thread switches. A
    scheduler that defers to the last moment would miss deadlines by them, so each task's deadline
    is moved forward by a high quantile of the recent overhead; results are judged by the true
    deadline.
    """

    def __init__(self) -> None:
        self._ways: deque[int] = deque(maxlen=_KEPT)
        self._delays: deque[int] = deque(maxlen=_KEPT)
        self._reserve = _AT_FIRST
        self._news = 0

    def travelled(self, answer: Message[object], taken: int) -> None:
        """Add an execution on the edge.

        Args:
            answer: Its answer, whose last span is the work.
            taken: Time from sending the task to the answer, nanoseconds.
        """
        work = answer.spans[-1].published - answer.spans[-1].received
        self._ways.append(max(0, taken - work))
        self._refresh()

    def delayed(self, late: int) -> None:
        """Add a timer that was `late` nanoseconds late."""
        self._delays.append(max(0, late))
        self._refresh()

    def reserve(self, deadline: int) -> int:
        """Nanoseconds to subtract from a relative deadline."""
        return min(self._reserve, int(_LARGEST_SHARE * deadline))

    def _refresh(self) -> None:
        self._news += 1
        if self._news >= _ENOUGH and len(self._ways) >= _ENOUGH:
            self._news = 0
            self._reserve = _high(self._ways) + _high(self._delays)


def _high(samples: deque[int]) -> int:
    return sorted(samples)[int(_QUANTILE * (len(samples) - 1))] if samples else 0
