"""What every driver does with a setpoint before it is sent: checks, and a speed that it may fly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry.frames import is_finite
from aerodaas.messages.vehicle import PositionSetpoint, Setpoint, VelocitySetpoint

__all__ = ["require_finite", "slowed"]


def slowed(
    setpoint: PositionSetpoint, cruise: float, fastest: float
) -> tuple[PositionSetpoint, float]:
    """`setpoint` with a speed that can be flown, and that speed in m/s.

    Its place is passed no faster than the way there is flown.

    Args:
        setpoint: The setpoint.
        cruise: Speed if it names none, m/s.
        fastest: Largest speed, m/s.
    """
    speed = min(cruise if setpoint.speed is None else float(setpoint.speed), fastest)
    passing = min(float(setpoint.passing_speed), speed)
    return replace(setpoint, speed=speed, passing_speed=passing), speed


def require_finite(name: str, setpoint: Setpoint) -> None:
    """Check that the numbers of `setpoint` can be flown.

    Args:
        name: Id of the robot, for the error.
        setpoint: The setpoint.

    Raises:
        InvalidWaypointError: If a number is not finite, a speed not positive, or a passing speed
            negative.
    """
    if isinstance(setpoint, VelocitySetpoint):
        vectors = [setpoint.velocity]
        scalars: dict[str, float | None] = {"yaw_rate": setpoint.yaw_rate}
    else:
        begins = setpoint.line_from
        vectors = [setpoint.position, *([] if begins is None else [begins])]
        scalars = {
            "yaw": setpoint.yaw,
            "speed": setpoint.speed,
            "passing_speed": setpoint.passing_speed,
        }
    for vector in vectors:
        if np.shape(vector) != (3,) or not is_finite(vector):
            raise InvalidWaypointError(
                f"{name}: a setpoint needs three finite numbers, not {vector}"
            )
    for key, value in scalars.items():
        if value is not None and not math.isfinite(value):
            raise InvalidWaypointError(f"{name}: a setpoint's {key} must be finite, not {value}")
    speed = scalars.get("speed")
    if speed is not None and speed <= 0:
        raise InvalidWaypointError(f"{name}: a setpoint's speed must be positive, not {speed}")
    passing = scalars.get("passing_speed")
    if passing is not None and passing < 0:
        raise InvalidWaypointError(
            f"{name}: a setpoint's passing_speed must not be negative, not {passing}"
        )
