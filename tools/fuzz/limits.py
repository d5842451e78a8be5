"""Limits of one input: time of the processor and by the wall; memory of this process."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import psutil

__all__ = ["Alarm", "Limits", "TooLongError", "kept_waiting", "memory"]


class TooLongError(BaseException):
    """An input took more time than its limit; no `except Exception` of the target stops it."""


@dataclass(frozen=True)
class Limits:
    """What one input may take."""

    seconds: float = 5.0
    """Of the processor. A good recording's plots take two on a slow core."""
    wall: float = 25.0
    """By the wall clock, without the time in which other programs kept the process waiting."""
    memory: int = 512 * 2**20
    """Bytes on top of what the process has before its first input."""


class Alarm:
    """Interrupts what takes too long, again and again if the target catches it."""

    _AGAIN = 0.5

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._struck = False
        self._armed = False
        self._begun = 0.0
        signal.signal(signal.SIGPROF, self._strike)
        signal.signal(signal.SIGALRM, self._strike_by_the_wall)

    @contextmanager
    def set(self) -> Iterator[None]:
        """Raise TooLongError if the block takes too long, also if the block caught it."""
        self._struck, self._armed = False, True
        self._begun = time.monotonic() - kept_waiting()
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

    def _strike_by_the_wall(self, number: int, frame: FrameType | None) -> None:
        if time.monotonic() - kept_waiting() - self._begun >= self._limits.wall:
            self._strike(number, frame)

    def _strike(self, _signal: int, _frame: FrameType | None) -> None:
        if self._armed:
            self._struck = True
            raise TooLongError("the input took too long")


def kept_waiting(process: int | None = None) -> float:
    """Seconds in which a process (None: this one) was ready to run and had no processor.

    Of its main thread; 0 where Linux does not tell, or once the process has ended.
    """
    try:
        told = Path(f"/proc/{process or 'self'}/schedstat").read_text(encoding="ascii")
    except OSError:
        return 0.0
    return int(told.split()[1]) / 1e9


def memory() -> int:
    """Bytes of this process that are in memory."""
    return int(psutil.Process().memory_info().rss)
