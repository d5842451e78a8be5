"""The mission clock: wall time, scaled time, or lockstep, behind one protocol.

Every stamp in this project is an integer of nanoseconds on the mission clock, which reads zero
when the mission's actors start. Latencies are taken on `host_time_ns`, because simulated time
may stand still while a frame is processed.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from aerodaas.types.errors import ClockError, ConfigError

__all__ = [
    "NANOSECONDS",
    "Clock",
    "LockstepClock",
    "ScaledClock",
    "host_time_ns",
    "seconds",
]

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""


_EPOCH_OFFSET = time.time_ns() - time.monotonic_ns()


def host_time_ns() -> int:
    """Nanoseconds since the Unix epoch that never step backwards within a process.

    Comparable between processes of one host to some microseconds, and between hosts as well as
    their clocks are kept together.
    """
    return time.monotonic_ns() + _EPOCH_OFFSET


def seconds(nanoseconds: int) -> float:
    """Convert a stamp or a duration from nanoseconds to seconds."""
    return nanoseconds / NANOSECONDS


@runtime_checkable
class Clock(Protocol):
    """Mission time in nanoseconds, zero at the start of the mission."""

    def now(self) -> int:
        """Nanoseconds of mission time."""
        ...

    def sleep_until(self, stamp: int) -> None:
        """Return when mission time has reached `stamp` (at once if it already has)."""
        ...


@dataclass(frozen=True)
class ScaledClock:
    """Host time from `origin_ns`, running `speed` times as fast; a speed of 1 is wall time.

    Two processes of one host that hold equal instances read the same time, so a clock is sent
    to each actor by value.
    """

    speed: float = 1.0
    origin_ns: int = field(default_factory=host_time_ns)

    def __post_init__(self) -> None:
        """Refuse speeds that are not positive and finite."""
        if not 0.0 < self.speed < float("inf"):
            message = f"a clock's speed must be positive and finite, not {self.speed}"
            raise ConfigError(message)

    def now(self) -> int:
        """Nanoseconds of mission time."""
        return int((host_time_ns() - self.origin_ns) * self.speed)

    def sleep_until(self, stamp: int) -> None:
        """Sleep on the host until mission time reaches `stamp`."""
        remaining = (stamp - self.now()) / self.speed / NANOSECONDS
        if remaining > 0:
            time.sleep(remaining)


class LockstepClock:
    """Mission time that moves only when `advance_to` is called, as fast as the machine goes.

    The conductor (the simulated drone's actor) advances it; everyone else follows the stamps of
    the messages that they receive. Nothing here depends on the host's speed, so the same seed
    gives the same run to the last digit.
    """

    def __init__(self) -> None:
        """Start at zero."""
        self._now = 0
        self._changed = threading.Condition()

    def now(self) -> int:
        """Nanoseconds of mission time."""
        return self._now

    def advance_to(self, stamp: int) -> None:
        """Move time forward to `stamp` and wake sleepers; raise ClockError if it is in the past."""
        with self._changed:
            if stamp < self._now:
                message = f"mission time cannot run backwards, from {self._now} to {stamp} ns"
                raise ClockError(message)
            self._now = stamp
            self._changed.notify_all()

    def sleep_until(self, stamp: int) -> None:
        """Block the calling thread until another one advances time to `stamp`."""
        with self._changed:
            self._changed.wait_for(lambda: self._now >= stamp)
