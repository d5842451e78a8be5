"""Reference frames of recordings and bags: their names, and velocities in the body's own axes."""

from __future__ import annotations

import numpy as np

from aerodaas.geometry.frames import Vector, rotation_from_rpy
from aerodaas.messages.odometry import Odometry

__all__ = ["MAP_FRAME", "base_link", "body_twist"]

MAP_FRAME = "map"
"""The local frame (REP 105), which is ENU as ours."""


def base_link(robot: str) -> str:
    """Name of a robot's body frame, which is FLU."""
    return f"{robot}/base_link"


def body_twist(odometry: Odometry) -> tuple[Vector, Vector]:
    """Velocity (m/s) and turn rates (rad/s) in the axes of the body, which leans.

    Of the rates only the turn about the vertical is known.
    """
    to_body = rotation_from_rpy(odometry.roll, odometry.pitch, odometry.yaw).T
    return to_body @ odometry.velocity, to_body @ np.array([0.0, 0.0, odometry.yaw_rate])
