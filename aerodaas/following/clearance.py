"""Room to fly towards a target: what a depth camera shows at the drone's own height counts.

A follower flies along its line of sight, and who is seen past the corner of a wall is seen along
the wall. Nothing here finds a way around: the drone stops before what stands in its way.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.types.braking import braking_speed
from aerodaas.types.data import Detections, Odometry
from aerodaas.types.depth import METRE
from aerodaas.types.geometry import rotation_from_rpy

__all__ = ["Clearance", "surfaces"]

_BELOW, _ABOVE = 0.5, 0.4
"""Metres from the body's centre within which a surface is at the drone's own height."""
_GROUND = 0.3
"""Metres above home below which it is the ground, or what lies on it."""
_HALF_WIDTH = 0.5
"""Metres to the side of the way that are to be free: half a drone, and what the wind moves it."""
_BEFORE = 0.8
"""Metres from the body's centre at which it stops before a surface."""
_BODY = 0.7
"""Metres around the target within which surfaces are its own; the approach to it is limited."""


def surfaces(seen: Detections) -> NDArray[np.float64] | None:
    """Forward and left of the body, (n, 2) in metres, of what is at the drone's own height.

    In the level body frame. None where the frame has no depth or the camera is not calibrated.
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
    """Remembers the surfaces of the newest depth picture, and takes them to stand still."""

    def __init__(self, limits: FollowLimits, nearest: float) -> None:
        """Stop 0.8 m before what is in the way, or `nearest` where the target is let so near."""
        self._limits = limits
        self._before = min(_BEFORE, nearest)
        self._points: NDArray[np.float64] = np.zeros((0, 2))
        self._at: Odometry | None = None
        self._interval = 0.0

    def see(
        self, points: NDArray[np.float64] | None, at_capture: Odometry | None, interval: float
    ) -> None:
        """Take in the surfaces of a picture taken `interval` seconds after the last.

        None, of a picture without depth, leaves those before.
        """
        if points is not None:
            self._points, self._at, self._interval = points, at_capture, interval

    def speed(self, towards: RelativeTarget, now: Odometry | None) -> float:
        """Fastest speed in m/s along the line of sight `towards`: infinite where it is free."""
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
