"""Conditions of triggers that are data: they can be written into a mission document."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist

from aerodaas.messages.readings import Readings

__all__ = ["Above", "Below", "Near"]


@dataclass(frozen=True)
class Near:
    """Whether readings of the position are within `metres` of a place, along the ground."""

    place: tuple[float, float]
    """Metres east and north of home."""
    metres: float
    """Distance from the place."""

    def __call__(self, result: object) -> bool:
        """Look at one result; True only for readings of `position`."""
        values = result.values if isinstance(result, Readings) else {}
        east, north = values.get("position.east"), values.get("position.north")
        return (
            east is not None and north is not None and dist((east, north), self.place) < self.metres
        )


@dataclass(frozen=True)
class Below:
    """Whether a reading, such as `battery`, is below a limit."""

    reading: str
    """Name of the reading, as `MonitoringAnalytics` has it."""
    limit: float
    """In the unit of the reading."""

    def __call__(self, result: object) -> bool:
        """Look at one result; True only for readings that have this one."""
        value = result.values.get(self.reading) if isinstance(result, Readings) else None
        return value is not None and value < self.limit


@dataclass(frozen=True)
class Above:
    """Whether a reading, such as `height`, is above a limit."""

    reading: str
    """Name of the reading, as `MonitoringAnalytics` has it."""
    limit: float
    """In the unit of the reading."""

    def __call__(self, result: object) -> bool:
        """Look at one result; True only for readings that have this one."""
        value = result.values.get(self.reading) if isinstance(result, Readings) else None
        return value is not None and value > self.limit
