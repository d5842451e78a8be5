"""Requests of motion by a mission to the setpoint loop, one a turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from aerodaas.geometry.frames import Vector
from aerodaas.messages.frames import Header
from aerodaas.messages.vehicle import Setpoint

__all__ = ["Fly", "Hold", "Land", "MotionRequest", "Return", "Supervise", "TakeOff", "Wait"]


@dataclass(frozen=True, slots=True)
class Wait:
    """Send nothing: the drone is on the ground, or a pilot or the autopilot's failsafe flies."""


@dataclass(frozen=True, slots=True)
class TakeOff:
    """Arm and climb to `height` metres above the ground."""

    height: float


@dataclass(frozen=True, slots=True, eq=False)
class Fly:
    """Send this setpoint after clamping."""

    setpoint: Setpoint
    cause: Header | None = None
    """Header of the measurement behind it, if analytics made the setpoint."""


@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """Stop and hold `position` (ENU metres), or, without a position, where the vehicle stops."""

    position: Vector | None


@dataclass(frozen=True, slots=True)
class Return:
    """Start the autopilot's own return mode: no position estimate is available for setpoints."""


@dataclass(frozen=True, slots=True)
class Supervise:
    """Send nothing: the autopilot flies the mission's waypoints, within the drone's limits."""


@dataclass(frozen=True, slots=True)
class Land:
    """Land at the current position."""


MotionRequest: TypeAlias = Wait | TakeOff | Fly | Hold | Supervise | Return | Land
