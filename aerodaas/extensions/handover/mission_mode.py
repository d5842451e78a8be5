"""An autopilot's own mission mode: it flies a plan by itself, place by place.

A driver whose vehicle has one lists it in its `equipment`. The vehicle is taken back by any
setpoint, or by an order to hold, return or land: those always come first.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from aerodaas.geometry.frames import Vector

__all__ = ["MissionMode", "MissionModePhase", "PlanProgress", "PlannedPlace"]


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPlace:
    """One place of a plan."""

    position: Vector
    """Metres, ENU."""
    speed: float
    """m/s on the way there."""
    hover: float = 0.0
    """Seconds to stay."""
    yaw: float | None = None
    """Radians counter-clockwise from east on arrival; None keeps the direction of flight."""


class MissionModePhase(enum.Enum):
    """How far a plan has come."""

    NONE = enum.auto()
    """There is none, or it was left."""
    UPLOADING = enum.auto()
    READY = enum.auto()
    """The vehicle holds it, and would begin with its first place."""
    STARTING = enum.auto()
    """The mode was asked for, and is not shown yet; setpoints are followed until then."""
    FLYING = enum.auto()
    FAILED = enum.auto()
    """It was refused, or not answered."""


@dataclass(frozen=True, slots=True)
class PlanProgress:
    """Progress of the vehicle's own plan."""

    phase: MissionModePhase = MissionModePhase.NONE
    fault: str = ""
    """Why it failed, or what the vehicle says that cannot be; one sentence."""
    done: int = 0
    """How many places, counted from the first, it says that it is done with."""


@runtime_checkable
class MissionMode(Protocol):
    """The mission mode of one vehicle; every method returns at once."""

    def objection(self, places: Sequence[PlannedPlace]) -> str:
        """Why it cannot fly these places, or not now; empty if it can."""
        ...

    def upload(self, places: Sequence[PlannedPlace]) -> None:
        """Begin to replace the plan on the vehicle, which flies on as it does.

        The last place is followed by a short stay, and then by the way home, for a vehicle that is
        not taken back. Raises VehicleError where it has an objection.
        """
        ...

    def start(self) -> None:
        """Fly the plan that is READY; raises VehicleError if none is, or if somebody else flies."""
        ...

    def clear(self) -> None:
        """Forget the plan; what flies the vehicle next is the caller's next order to it."""
        ...

    @property
    def progress(self) -> PlanProgress:
        """How far the plan has come."""
        ...
