"""Data of the terminal view: the mission at one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from aerodaas.messages.mission import RobotStatus

__all__ = ["Snapshot", "StreamSnapshot"]


@dataclass(frozen=True, slots=True)
class StreamSnapshot:
    """One stream."""

    name: str
    rate: float | None = None
    """Items per mission second."""
    median_ms: float | None = None
    """From capture to publishing, milliseconds of the host's clock."""
    p99_ms: float | None = None
    drops: int = 0
    """Items that newer ones replaced before they were read."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole mission at one moment."""

    title: str
    mission_time: float
    """Mission seconds."""
    wall_time: float
    """Seconds on the host since the mission clock started."""
    robots: Mapping[str, RobotStatus] = field(default_factory=dict)
    """By id."""
    streams: tuple[StreamSnapshot, ...] = ()
    alerts: tuple[str, ...] = ()
    """One line each, newest last; the view shows the last few."""
    scheduler: str = ""
    """Figures of the analytics scheduler in one line; empty without one."""
    speed: float | None = None
    """Mission seconds per wall second; None: computed from the two times."""

    @property
    def factor(self) -> float:
        """Mission seconds per wall second."""
        if self.speed is not None:
            return self.speed
        return self.mission_time / self.wall_time if self.wall_time > 0 else 0.0
