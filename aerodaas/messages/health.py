"""Health before flight: what a vehicle tells about itself, and how that is judged."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from aerodaas.messages.payload import CameraStatus
from aerodaas.messages.vehicle import Vehicle

__all__ = [
    "OWN_CHECKS",
    "HealthItem",
    "HealthReadings",
    "HealthReport",
    "MeasuredVehicle",
    "Verdict",
    "gravest",
]

OWN_CHECKS = "vehicle"
"""Name of the item of the vehicle's own objections (`Vehicle.preflight`)."""


@dataclass(frozen=True, slots=True)
class HealthReadings:
    """Health readings beyond the vehicle's state; None is not known, which is not good."""

    cells: tuple[float, ...] | None = None
    """Volts of each cell of the battery."""
    cycles: int | None = None
    """Charging cycles of the battery."""
    vibration: float | None = None
    """m/s², of the axis that shakes most."""
    compass: float | None = None
    """Misfit as a share of what the estimator rejects, from 0."""
    estimator: float | None = None
    """The largest misfit of its position, velocity and height, likewise; with ArduPilot also of the
    compass."""
    gps_fix: bool | None = None
    """Whether the GPS has a position in space."""
    gps_rtk: str = ""
    """How far corrections of a base station have come: "RTK float", "RTK fixed", or none."""
    logs: bool | None = None
    """Whether the vehicle can write its own log."""
    wind: float | None = None
    """m/s along the ground."""
    silence: float | None = None
    """Seconds since the vehicle's last word."""
    clock: float | None = None
    """Seconds since the Unix epoch where the vehicle is; a simulation has no date."""
    stranded: tuple[str, ...] | None = None
    """Why it would not come home by itself once this process is gone; empty if it would."""
    cameras: tuple[CameraStatus, ...] | None = None
    """What its cameras say that they are and do; empty for none that has answered."""
    objections: Mapping[str, str] = field(default_factory=dict)
    """What other equipment objects to, by its item in the list before take-off; empty text if it is
    ready."""


@runtime_checkable
class MeasuredVehicle(Vehicle, Protocol):
    """A vehicle that tells of its health."""

    def health(self) -> HealthReadings:
        """The newest readings; raises VehicleError if not connected."""
        ...


class Verdict(str, enum.Enum):
    """Verdict of an item on a take-off."""

    GOOD = "good"
    WARNING = "warning"
    REFUSED = "refused"
    UNKNOWN = "unknown"
    """Nothing is known, and nothing was required to be."""


@dataclass(frozen=True, slots=True)
class HealthItem:
    """One item of the list before take-off."""

    name: str
    value: str
    """What was found; `not known` without a reading."""
    bound: str
    """What it should be, to be read after these words; empty where nothing more is to be said."""
    verdict: Verdict
    remedy: str = ""
    """What to do about a warning or a refusal."""

    @property
    def text(self) -> str:
        """One sentence: what was found, and what it should be.

        The vehicle's own objections stand in it alone, as it words them.
        """
        if self.name == OWN_CHECKS:
            return self.value
        should = f", should be {self.bound}" if self.bound else ""
        return f"{self.name}: {self.value}{should}"


@dataclass(frozen=True, slots=True)
class HealthReport:
    """A robot's list before take-off, as it was examined last."""

    items: tuple[HealthItem, ...] = ()
    """Empty where it was never examined."""
    age: float | None = None
    """Seconds since then: of the mission's clock while a mission flies the robot."""

    @property
    def verdict(self) -> Verdict | None:
        """Gravest verdict of the items; None where the list was never examined."""
        return gravest(self.items) if self.items else None


def gravest(items: Iterable[HealthItem]) -> Verdict:
    """Gravest verdict of the items: `REFUSED`, `WARNING`, or else `GOOD`."""
    found = {one.verdict for one in items}
    grave = (one for one in (Verdict.REFUSED, Verdict.WARNING) if one in found)
    return next(grave, Verdict.GOOD)
