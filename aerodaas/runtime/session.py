"""Session of a run: the data that each of its nodes receives."""

from __future__ import annotations

import uuid
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from aerodaas.clock import NANOSECONDS, Clock, HostEpoch, ScaledClock, SimulatedClock
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import EdgeShare
from aerodaas.runtime.node import NEVER

__all__ = [
    "CONTROL_PERIOD_NS",
    "CONTROL_RATE",
    "FRAME_DEPTH",
    "MESSAGE_DEPTH",
    "Session",
    "next_due",
]

FRAME_DEPTH = 8
"""Queue depth of frames for a reader of all of them; each is megabytes of shared memory."""
MESSAGE_DEPTH = 32
"""Queue depth of other messages for a reader of all of them."""
CONTROL_RATE = 20.0
"""Setpoint loop cycles per second: ten times the rate that PX4 requires in offboard mode."""
CONTROL_PERIOD_NS = int(NANOSECONDS / CONTROL_RATE)


@dataclass(frozen=True)
class Session:
    """One run, sent by value to each of its actors."""

    environment: EnvironmentConfig
    speed: float | None = 1.0
    """Mission seconds per wall second; None for simulated time."""
    id: str = field(default_factory=lambda: f"aerodaas/{uuid.uuid4().hex[:12]}")
    """Prefix of the run's stream names; unique on a host."""
    origin_ns: int | None = None
    """Host time at which mission time is zero; None before the start, while it stands at zero."""
    timetables: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    """Sorted timestamps in nanoseconds at which sources without a rate are due."""
    edge: EdgeShare | None = None
    """Share of an edge that other flights use, too; None in simulated time."""
    locks: Path | None = None
    """Folder of a provider's locks, which the drones' actors on its machine hold."""
    application: Any = None
    """Definitions of the application, which an actor's process unpickles with its session."""
    epoch: HostEpoch = field(default_factory=HostEpoch)
    """Clock of the application's process, which the actors on its machine take over."""

    def next_due(self, source: str, rate: float, after: int) -> int:
        """First timestamp at which `source` is due; NEVER after the end of its timetable.

        Args:
            source: Stream of the source.
            rate: Hz, for a source without timetable.
            after: Mission clock, nanoseconds; the timestamp is later.
        """
        stamps = self.timetables.get(source)
        if stamps is None:
            return next_due(rate, after)
        place = bisect_right(stamps, after)
        return stamps[place] if place < len(stamps) else NEVER

    def scope(self, node_id: str) -> str:
        """Prefix of the run's stream names on one Ray node; two nodes may share a host."""
        return f"{self.id}/{node_id[:12]}"

    def starting_at(self, origin_ns: int) -> Session:
        """Copy of the session with mission time zero at this host time."""
        return replace(self, origin_ns=origin_ns)

    @property
    def simulated(self) -> bool:
        """True if mission time is simulated: it advances when all of a moment is done."""
        return self.speed is None

    @property
    def simulates_executions(self) -> bool:
        """True in simulated time, if tasks of the analytics scheduler take mission time."""
        return self.simulated and self.environment.simulation.execution_times is not None

    def clock(self) -> Clock:
        """New mission clock for a process of this run."""
        if self.speed is None or self.origin_ns is None:
            return SimulatedClock()
        return ScaledClock(self.speed, self.origin_ns)

    def host_seconds(self, mission_ns: int) -> float:
        """Wall seconds that `mission_ns` nanoseconds of mission time take."""
        return mission_ns / NANOSECONDS / (self.speed or 1.0)


def next_due(rate: float, after: int) -> int:
    """First timestamp at which a source is due, nanoseconds.

    Args:
        rate: Hz.
        after: Mission clock, nanoseconds; the timestamp is later.
    """
    index = int(after * rate / NANOSECONDS) + 1
    while _stamp(rate, index - 1) > after:
        index -= 1
    while _stamp(rate, index) <= after:
        index += 1
    return _stamp(rate, index)


def _stamp(rate: float, index: int) -> int:
    return int(index * NANOSECONDS / rate)
