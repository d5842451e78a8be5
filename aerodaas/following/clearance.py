"""Clearance for the approach to a target, from depth images at the drone's own height.

A follower flies along its line of sight, which may graze the corner of a wall. No path around an
obstacle is planned: the drone stops in front of it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.geometry.braking import braking_speed
from aerodaas.geometry.depth import METRE
from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.messages.detections import Detections
from aerodaas.messages.odometry import Odometry

__all__ = ["Clearance", "surfaces"]

_BELOW, _ABOVE = 0.5, 0.4
"""Vertical distances in metres from the body's centre within which a surface is an obstacle."""
_GROUND = 0.3
"""Height above home in metres below which a surface is the ground, or an object lying on it."""
_HALF_WIDTH = 0.5
"""Half the width of the corridor in metres: half a drone, and its displacement by wind."""
_BEFORE = 0.8
"""Distance of the body's centre from a surface at which the drone stops, metres."""
_BODY = 0.7
"""Radius around the target within which surfaces belong to it, metres; `ApproachLimit` keeps the
distance to the target itself."""


def surfaces(seen: Detections) -> NDArray[np.float64] | None:
    """Positions (n, 2) of the surfaces at the drone's own height, metres forward and left.

    In the level body frame. None if the frame has no depth or the camera is not calibrated.
    """
    cells, camera, odometry = seen.nearest, seen.camera, seen.odometry
    if cells is None or camera is None:
        return None
    rows, columns = np.nonzero(cells)
    u = (columns + 0.5) * camera.width / cells.shape[1]
    v = (rows + 0.5) * camera.height / cells.shape[0]
    depth = cells[rows, columns] / METRE
    sides, downs = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    optical = depth[:, None] * np.stack([sides, downs, np.ones_like(u)], axis=-1)
    level, floor = np.eye(3), -math.inf
    if odometry is not None and math.isfinite(odometry.roll + odometry.pitch + odometry.height):
        level = rotation_from_rpy(odometry.roll, odometry.pitch, 0.0)
        floor = _GROUND - odometry.height
    points = (optical @ camera.body_from_optical.T + np.array(camera.mount)) @ level.T
    up = points[:, 2]
    return np.asarray(points[(up > max(-_BELOW, floor)) & (up < _ABOVE), :2])


class Clearance:
    """Speed limit by the surfaces of the newest depth image, which are assumed to be static."""

    def __init__(self, limits: FollowLimits, nearest: float) -> None:
        """Stop 0.8 m before an obstacle, or `nearest` metres if that is less."""
        self._limits = limits
        self._before = min(_BEFORE, nearest)
        self._points: NDArray[np.float64] = np.zeros((0, 2))
        self._at: Odometry | None = None
        self._interval = 0.0

    def see(
        self, points: NDArray[np.float64] | None, at_capture: Odometry | None, interval: float
    ) -> None:
        """Store the surfaces of a frame captured `interval` seconds after the last.

        None, for a frame without depth, keeps the previous ones.
        """
        if points is not None:
            self._points, self._at, self._interval = points, at_capture, interval

    def speed(self, towards: RelativeTarget, now: Odometry | None) -> float:
        """Highest safe speed along the line of sight `towards`, m/s; infinite if it is free."""
        points = self._points
        if self._at is not None and now is not None:
            east_north = self._at.position[:2] + points @ _turn(self._at.yaw).T
            points = (east_north - now.position[:2]) @ _turn(now.yaw)
        points = points[np.linalg.norm(points - towards.offset, axis=1) > _BODY]
        along, aside = (points @ _turn(towards.bearing)).T
        ahead = along[(along > 0.0) & (along < towards.distance) & (np.abs(aside) < _HALF_WIDTH)]
        if not ahead.size:
            return math.inf
        reaction_time = self._limits.reaction_time + self._interval
        return braking_speed(float(ahead.min()) - self._before, self._limits.braking, reaction_time)


def _turn(angle: float) -> NDArray[np.float64]:
    """Rotation matrix (2, 2), counter-clockwise."""
    return rotation_from_rpy(0.0, 0.0, angle)[:2, :2]
