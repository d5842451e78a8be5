"""Frames of reference, and rotations as quaternions, as Foxglove and ROS have them."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from aerodaas.geometry.frames import Vector, rotation_from_rpy
from aerodaas.messages.odometry import Odometry

__all__ = ["MAP_FRAME", "OPTICAL", "Rotation", "base_link", "body_twist", "compose", "from_rpy"]

Rotation: TypeAlias = tuple[float, float, float, float]
"""A unit quaternion: x, y, z, w."""

OPTICAL: Rotation = (-0.5, 0.5, -0.5, 0.5)
"""Rotates optical-frame vectors (x right, y down, z forward) to an FLU frame."""
MAP_FRAME = "map"
"""The local frame (REP 105), which is ENU as ours."""


def from_rpy(roll: float, pitch: float, yaw: float) -> Rotation:
    """Quaternion of intrinsic z-y-x angles, as in `geometry.rotation_from_rpy`.

    Args:
        roll: Radians; positive lowers the right side.
        pitch: Radians; positive turns the nose down.
        yaw: Radians about the vertical.

    Returns:
        x, y, z, w.
    """
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def compose(first: Rotation, second: Rotation) -> Rotation:
    """Hamilton product of two rotations.

    Args:
        first: Quaternion that is applied last.
        second: Quaternion that is applied first.
    """
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def base_link(robot: str) -> str:
    """Name of a robot's body frame, which is FLU."""
    return f"{robot}/base_link"


def body_twist(odometry: Odometry) -> tuple[Vector, Vector]:
    """Velocity (m/s) and turn rates (rad/s) in the axes of the body, which leans.

    Of the rates only the turn about the vertical is known.
    """
    to_body = rotation_from_rpy(odometry.roll, odometry.pitch, odometry.yaw).T
    return to_body @ odometry.velocity, to_body @ np.array([0.0, 0.0, odometry.yaw_rate])
