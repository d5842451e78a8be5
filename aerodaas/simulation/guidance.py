"""Position loop of the simulated autopilot: position error to velocity."""

from __future__ import annotations

import math

from aerodaas.simulation.dynamics import Triple

__all__ = ["approach_speed", "braking_distance", "velocity_towards", "yaw_rate_towards"]

_POSITION_GAIN = 1.2
"""Proportional gain close to the target, 1/s."""

_BRAKING_SHARE = 0.5
"""Fraction of the acceleration limit used to plan braking; the rest is reserve for lag and wind."""

_YAW_GAIN = 1.8
"""Proportional gain of the yaw, 1/s."""


def approach_speed(distance: float, max_acceleration: float) -> float:
    """Highest speed in m/s from which the vehicle can stop within `distance` metres.

    Proportional close to the target, a square root farther away, joined smoothly: ArduPilot's
    `sqrt_controller`.
    """
    braking = _BRAKING_SHARE * max_acceleration
    linear = braking / _POSITION_GAIN**2
    if distance <= linear:
        return _POSITION_GAIN * distance
    return math.sqrt(2.0 * braking * (distance - 0.5 * linear))


def braking_distance(speed: float, max_acceleration: float) -> float:
    """Metres within which the vehicle stops from `speed` m/s; the inverse of `approach_speed`."""
    braking = _BRAKING_SHARE * max_acceleration
    linear = braking / _POSITION_GAIN**2
    if speed <= _POSITION_GAIN * linear:
        return speed / _POSITION_GAIN
    return speed * speed / (2.0 * braking) + 0.5 * linear


def velocity_towards(
    position: Triple,
    target: Triple,
    *,
    speed: float,
    climb: float,
    max_acceleration: float,
    passing_speed: float = 0.0,
) -> Triple:
    """Velocity (ENU m/s) that leads from `position` straight to `target`.

    It stops there, or passes it at `passing_speed` m/s. `speed` bounds it horizontally and `climb`
    vertically.
    """
    x, y, z = target[0] - position[0], target[1] - position[1], target[2] - position[2]
    across = math.hypot(x, y)
    distance = math.hypot(across, z)
    if distance <= 0.0:
        return 0.0, 0.0, 0.0
    room = distance + braking_distance(passing_speed, max_acceleration)
    rate = approach_speed(room, max_acceleration) / distance
    if across * rate > speed:
        rate = speed / across
    if abs(z) * rate > climb:
        rate = climb / abs(z)
    return x * rate, y * rate, z * rate


def yaw_rate_towards(yaw: float, target: float) -> float:
    """Yaw rate in rad/s that turns from `yaw` to `target` by the smaller angle."""
    return _YAW_GAIN * math.remainder(target - yaw, math.tau)
