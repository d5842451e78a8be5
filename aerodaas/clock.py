"""The mission clock: wall time, scaled time or simulated time, behind one protocol.

Every stamp in this project is an integer of nanoseconds on the mission clock, which reads zero
when the mission starts. Latencies are taken on `host_time_ns`, because simulated time
may stand still while a frame is processed.

The wall clock may be set at any time, by NTP or by hand. Durations therefore go by
`time.monotonic`, and host times that one process tells another of its machine by `HostEpoch`.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from typing_extensions import Self

from aerodaas.errors import ClockError, ConfigError

__all__ = [
    "NANOSECONDS",
    "Clock",
    "HostEpoch",
    "ScaledClock",
    "SimulatedClock",
    "WallOffset",
    "host_time_ns",
    "seconds",
]

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""
_READING_SECONDS = 0.01
"""Most seconds between two readings of `time.monotonic` around one of the wall clock."""
_BOOT = Path("/proc/sys/kernel/random/boot_id")


def _boot() -> str:
    """Identity of the machine's present boot, which `time.monotonic` counts from."""
    try:
        return _BOOT.read_text(encoding="ascii").strip()
    except OSError:
        return ""


@dataclass(frozen=True)
class WallOffset:
    """Unix time less `time.monotonic`: it changes when the wall clock is set, and only then."""

    boot: str
    """The machine's boot in which it was read."""
    seconds: float

    @classmethod
    def read(cls) -> Self:
        """The present offset of this machine."""
        while True:
            before, wall, after = time.monotonic(), time.time(), time.monotonic()
            if after - before < _READING_SECONDS:
                return cls(_boot(), wall - (before + after) / 2)

    @property
    def current(self) -> bool:
        """Whether it was read in this boot: `time.monotonic` has not begun anew since."""
        return bool(self.boot) and self.boot == _boot()

    def monotonic(self, moment: float) -> float:
        """`time.monotonic` of a moment in Unix seconds, told by the wall clock of that time."""
        return moment - (self if self.current else self.read()).seconds


_epoch_offset = round(WallOffset.read().seconds * NANOSECONDS)


def host_time_ns() -> int:
    """Nanoseconds since the Unix epoch that never step backwards within a process.

    Comparable between processes of one host to some microseconds, if one has sent the others its
    `HostEpoch`, and between hosts as well as their clocks are kept together.
    """
    return time.monotonic_ns() + _epoch_offset


@dataclass(frozen=True)
class HostEpoch:
    """This process' `host_time_ns`: a process of the same machine that unpickles it takes it over.

    Otherwise two processes would differ by what the wall clock was set by between their starts.
    """

    def __reduce__(self) -> tuple[Any, tuple[str, int]]:
        """Pickle it so that unpickling sets the clock."""
        return _adopted, (_boot(), _epoch_offset)


def _adopted(boot: str, offset: int) -> HostEpoch:
    global _epoch_offset  # noqa: PLW0603 - one clock of a process
    if boot and boot == _boot():
        _epoch_offset = offset
    return HostEpoch()


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


class SimulatedClock:
    """Mission time that stands still until `advance_to` moves it.

    The executor of a simulated flight advances it to the next moment at which a node is due.
    Mission time so depends on the flight alone, not on the host: the same seed gives the same
    flight to the last digit.
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
