"""What a mission wants done in this turn of the setpoint loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from aerodaas.data import Header
from aerodaas.geometry import Vector
from aerodaas.vehicle import Setpoint

__all__ = ["Action", "Fly", "Hold", "Land", "Return", "TakeOff", "Wait"]


@dataclass(frozen=True, slots=True)
class Wait:
    """Send nothing: on the ground, or somebody else flies."""


@dataclass(frozen=True, slots=True)
class TakeOff:
    """Arm and climb to `height` metres above the ground."""

    height: float


@dataclass(frozen=True, slots=True, eq=False)
class Fly:
    """Send this setpoint, clamped."""

    setpoint: Setpoint
    cause: Header | None = None
    """Measurement behind it, where analytics made it."""


@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """Stop and stay: at `position` (ENU metres), or where a vehicle without one stops."""

    position: Vector | None


@dataclass(frozen=True, slots=True)
class Return:
    """Let the vehicle return by itself: we have no position to fly it by."""


@dataclass(frozen=True, slots=True)
class Land:
    """Land here."""


Action: TypeAlias = Wait | TakeOff | Fly | Hold | Return | Land
