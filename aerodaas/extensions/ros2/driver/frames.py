"""Between a drone's odometry and home's ENU, and velocities as the drone takes them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from aerodaas.geometry.frames import Vector, body_to_enu, enu_to_body, rotation_from_rpy, wrap_angle
from aerodaas.messages.odometry import Odometry

__all__ = ["Alignment", "VelocityFrame", "velocity_in"]

VelocityFrame = Literal["body", "level", "world"]


@dataclass(frozen=True)
class Alignment:
    """Takes the odometry's frame to home's: turned about the vertical by `yaw`, then shifted."""

    yaw: float = 0.0
    shift: Vector = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def to(cls, start: Vector, yaw: float, first: Odometry) -> Alignment:
        """Such that a drone that tells the odometry `first` stands at `start`.

        Args:
            start: ENU metres.
            yaw: Its heading there, radians counter-clockwise from east.
            first: Its odometry in its own frame.
        """
        turn = wrap_angle(yaw - first.yaw)
        return cls(turn, start - body_to_enu(first.position, turn))

    def apply(self, odometry: Odometry) -> Odometry:
        """Convert odometry to home's ENU frame."""
        return replace(
            odometry,
            position=body_to_enu(odometry.position, self.yaw) + self.shift,
            velocity=body_to_enu(odometry.velocity, self.yaw),
            yaw=wrap_angle(odometry.yaw + self.yaw),
        )


def velocity_in(
    frame: VelocityFrame, velocity: Vector, odometry: Odometry, alignment: Alignment
) -> Vector:
    """A velocity in home's ENU (m/s) as the drone takes it.

    Args:
        frame: The axes that it takes velocities in.
        velocity: In home's ENU.
        odometry: Where the drone is, in home's ENU.
        alignment: Between its odometry's frame and home's.
    """
    if frame == "world":
        return enu_to_body(velocity, alignment.yaw)
    if frame == "level":
        return enu_to_body(velocity, odometry.yaw)
    attitude = rotation_from_rpy(odometry.roll, odometry.pitch, odometry.yaw)
    turned: Vector = attitude.T @ velocity
    return turned
