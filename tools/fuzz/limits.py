"""Limits of one input: time of the processor and by the wall; memory of this process."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

import psutil

__all__ = ["Alarm", "Limits", "TooLongError", "memory"]


class TooLongError(BaseException):
    """An input took more time than its limit; no `except Exception` of the target stops it."""


@dataclass(frozen=True)
class Limits:
    """What one input may take."""

    seconds: float = 2.0
    """Of the processor."""
    wall: float = 10.0
    """By the wall clock, in which other programs may keep the machine busy."""
    memory: int = 512 * 2**20
    """Bytes on top of what the process has before its first input."""


class Alarm:
    """Interrupts what takes too long, again and again if the target catches it."""

    _AGAIN = 0.5

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._struck = False
        self._armed = False
        signal.signal(signal.SIGPROF, self._strike)
        signal.signal(signal.SIGALRM, self._strike)

    @contextmanager
    def set(self) -> Iterator[None]:
        """Raise TooLongError if the block takes too long, also if the block caught it."""
        self._struck, self._armed = False, True
        signal.setitimer(signal.ITIMER_PROF, self._limits.seconds, self._AGAIN)
        signal.setitimer(signal.ITIMER_REAL, self._limits.wall, self._AGAIN)
        try:
            yield
        finally:
            self._armed = False
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        if self._struck:
            raise TooLongError("the input took too long, which the target caught")

    def _strike(self, _signal: int, _frame: FrameType | None) -> None:
        if self._armed:
            self._struck = True
            raise TooLongError("the input took too long")


def memory() -> int:
    """Bytes of this process that are in memory."""
    return int(psutil.Process().memory_info().rss)
