"""What a ground station's plan holds, whatever its file format."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.extensions.plans.formats.numbers import LatLon, finite_or_none, place

__all__ = ["MOST_ITEMS", "FenceCircle", "FencePolygon", "Notice", "Plan", "PlanHome", "PlanItem"]

MOST_ITEMS = 10_000
"""Most items of a plan that is read."""
_LISTED = 8
"""Item numbers that a notice lists one by one."""


@dataclass(frozen=True)
class PlanItem:
    """One command of a mission, as MAVLink has it."""

    number: int
    """Its place in the mission, from 1; 0 is home."""
    command: int
    """MAV_CMD."""
    frame: int
    """MAV_FRAME."""
    values: tuple[float | None, float | None, float | None, float | None]
    """Parameters 1 to 4; None for NaN, which leaves the choice to the autopilot."""
    x: float | None
    """Parameter 5: latitude in degrees, of a command that has a place."""
    y: float | None
    """Parameter 6: longitude in degrees."""
    z: float | None
    """Parameter 7: metres in `frame`."""
    continues: bool = True
    """Whether the autopilot goes on to the next item by itself."""


@dataclass(frozen=True)
class PlanHome:
    """Where a plan expects the vehicle to start: degrees, and metres above the sea if known."""

    latitude: float
    longitude: float
    altitude: float | None

    @classmethod
    def given(cls, latitude: object, longitude: object, altitude: object) -> PlanHome | None:
        """Read a file's home; None for one that was never set.

        Writers that know no home, or not its altitude, put null or zeros, which would lift what is
        above the sea by as much as the ground lies above it.

        Args:
            latitude: Degrees north.
            longitude: Degrees east.
            altitude: Metres above the sea.

        Raises:
            ConfigError: If it is no place, or its altitude no finite number.
        """
        if not latitude and not longitude:
            return None
        height = finite_or_none(altitude, "home: altitude")
        return cls(*place(latitude, longitude, "home"), height or None)


@dataclass(frozen=True)
class FencePolygon:
    """A polygon to stay within (`inclusion`) or out of."""

    inclusion: bool
    corners: tuple[LatLon, ...]


@dataclass(frozen=True)
class FenceCircle:
    """A circle to stay within (`inclusion`) or out of; `radius` in metres."""

    inclusion: bool
    centre: LatLon
    radius: float


@dataclass(frozen=True)
class Notice:
    """Part of a plan that a mission here does not carry out, with the reason."""

    numbers: tuple[int, ...]
    """Items that mean it; none for the plan as a whole."""
    command: str
    """MAVLink's name of the command, without MAV_CMD; or the part of the plan."""
    why: str
    """What happens instead."""

    def __str__(self) -> str:
        """One line."""
        if not self.numbers:
            return f"{self.command}: {self.why}"
        listed = ", ".join(map(str, self.numbers[:_LISTED]))
        more = len(self.numbers) - _LISTED
        listed += f" and {more} more" if more > 0 else ""
        return f"item{'s' * (len(self.numbers) > 1)} {listed}: {self.command}: {self.why}"


@dataclass(frozen=True)
class Plan:
    """A plan as read; `ardupilot` tells whose meaning of parameters its author had in mind."""

    items: tuple[PlanItem, ...]
    home: PlanHome | None = None
    ardupilot: bool = False
    fence: tuple[FencePolygon | FenceCircle, ...] = ()
    notices: tuple[Notice, ...] = ()
    """Parts of the file that are not even items."""
