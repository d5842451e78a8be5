"""Small pieces of motion control: braking distances and velocities towards a place."""

from __future__ import annotations

import math

import numpy as np

from aerodaas.geometry.frames import Vector, length, wrap_angle
from aerodaas.messages.vehicle import PositionSetpoint, VelocitySetpoint

__all__ = [
    "braking_distance",
    "braking_speed",
    "limit_length",
    "stopping_point",
    "velocity_towards",
]


def braking_speed(distance: float, deceleration: float, reaction_time: float) -> float:
    """The highest speed (m/s) from which a drone still stops within a distance.

    It flies on during the reaction and then brakes: v t + v²/(2 a) = d, solved for v.

    Args:
        distance: Metres; zero or less gives zero.
        deceleration: Braking in m/s².
        reaction_time: Seconds until braking begins.
    """
    if distance <= 0.0:
        return 0.0
    lag = deceleration * reaction_time
    return math.sqrt(lag * lag + 2.0 * deceleration * distance) - lag


def braking_distance(speed: float, deceleration: float, reaction_time: float) -> float:
    """Metres in which a drone stops; the inverse of `braking_speed`.

    Args:
        speed: Metres per second.
        deceleration: Braking in m/s².
        reaction_time: Seconds until braking begins.
    """
    return speed * reaction_time + speed * speed / (2.0 * deceleration)


def stopping_point(position: Vector, velocity: Vector, deceleration: float) -> Vector:
    """Where a drone comes to rest that brakes now: v²/(2 a) ahead.

    Args:
        position: Position of the drone, metres.
        velocity: Its velocity, m/s, in the same frame.
        deceleration: Braking in m/s².
    """
    speed = length(velocity)
    return position + velocity * (speed / (2.0 * deceleration))


def limit_length(vector: Vector, longest: float) -> Vector:
    """A vector, shortened where it is too long.

    Args:
        vector: The vector.
        longest: Greatest length, in its unit.
    """
    long = length(vector)
    return vector if long <= longest else vector * (longest / long)


def velocity_towards(
    target: PositionSetpoint,
    position: Vector,
    yaw: float,
    *,
    speed: float,
    deceleration: float,
    reaction_time: float,
    yaw_rate: float,
) -> VelocitySetpoint:
    """The velocity that flies to a target and stops there, or passes it at its passing speed.

    It does not overshoot.

    Args:
        target: The target, ENU metres.
        position: Position of the drone, ENU metres.
        yaw: Its yaw, radians.
        speed: Greatest speed in m/s, unless the target has its own.
        deceleration: Braking in m/s².
        reaction_time: Seconds until braking begins.
        yaw_rate: Greatest yaw rate in rad/s.
    """
    way = target.position - position
    distance = length(way)
    room = distance + braking_distance(target.passing_speed, deceleration, reaction_time)
    wanted = min(target.speed or speed, braking_speed(room, deceleration, reaction_time))
    velocity = way * (wanted / distance) if distance > 0.0 else np.zeros(3)
    gain = 1.5  # 1/s; turns settle in about two seconds
    error = 0.0 if target.yaw is None else wrap_angle(target.yaw - yaw)
    return VelocitySetpoint(velocity, min(max(gain * error, -yaw_rate), yaw_rate))
