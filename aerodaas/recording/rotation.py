"""Quaternions (x, y, z, w) for Foxglove's schemas."""

from __future__ import annotations

import math
from typing import TypeAlias

__all__ = ["OPTICAL", "Rotation", "compose", "from_rpy"]

Rotation: TypeAlias = tuple[float, float, float, float]
"""A unit quaternion: x, y, z, w."""

OPTICAL: Rotation = (-0.5, 0.5, -0.5, 0.5)
"""Rotates optical-frame vectors (x right, y down, z forward) to an FLU frame."""


def from_rpy(roll: float, pitch: float, yaw: float) -> Rotation:
    """Quaternion of intrinsic z-y-x angles in radians, as in `geometry.rotation_from_rpy`."""
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
    """Hamilton product: the rotation that applies `second`, then `first`."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
