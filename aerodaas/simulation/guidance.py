"""From where to go to how fast: the position loop of the simulated autopilot."""

from __future__ import annotations

import math

from aerodaas.simulation.dynamics import Triple

__all__ = ["approach_speed", "velocity_towards", "yaw_rate_towards"]

_POSITION_GAIN = 1.2
"""1/s, close to the target."""

_BRAKING_SHARE = 0.5
"""Share of the acceleration limit that braking plans with; the rest meets lag and wind."""

_YAW_GAIN = 1.8
"""1/s."""


def approach_speed(distance: float, max_acceleration: float) -> float:
    """Speed in m/s from which the vehicle can still stop within `distance` metres.

    Proportional close by, a square root further out, joined smoothly: ArduPilot's
    `sqrt_controller`.
    """
    braking = _BRAKING_SHARE * max_acceleration
    linear = braking / _POSITION_GAIN**2
    if distance <= linear:
        return _POSITION_GAIN * distance
    return math.sqrt(2.0 * braking * (distance - 0.5 * linear))


def velocity_towards(
    position: Triple, target: Triple, *, speed: float, climb: float, max_acceleration: float
) -> Triple:
    """Velocity (ENU m/s) that leads from `position` straight to `target` and stops there.

    `speed` bounds it horizontally and `climb` vertically.
    """
    x, y, z = (there - here for here, there in zip(position, target, strict=True))
    across = math.hypot(x, y)
    distance = math.hypot(across, z)
    if distance <= 0.0:
        return 0.0, 0.0, 0.0
    rate = approach_speed(distance, max_acceleration) / distance
    if across * rate > speed:
        rate = speed / across
    if abs(z) * rate > climb:
        rate = climb / abs(z)
    return x * rate, y * rate, z * rate


def yaw_rate_towards(yaw: float, target: float) -> float:
    """Yaw rate in rad/s that turns from `yaw` to `target` the short way round."""
    return _YAW_GAIN * math.remainder(target - yaw, math.tau)
