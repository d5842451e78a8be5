"""Projection of an image's pixels onto flat ground, from a drone of known height."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.messages.detections import Detections

__all__ = ["GroundView"]

Array = NDArray[np.float64]
_CORNERS = 64
_STEEPEST = 1e-6
_LOWEST = 0.05
"""Least height of the camera in metres; a camera lying on the ground does not see it."""


class GroundView:
    """Projection between one frame and the ground, which is flat and at the height of home.

    Ground coordinates are metres in the level body frame (forward, left), with the origin below
    the drone.
    """

    def __init__(self, detections: Detections) -> None:
        """Use the camera and pose of `detections`; raises ValueError if they are unknown."""
        camera, odometry = detections.camera, detections.odometry
        if camera is None or odometry is None:
            raise ValueError("the ground is found only from a calibrated camera of known height")
        level = rotation_from_rpy(odometry.roll, odometry.pitch, 0.0)
        self._rotation: Array = level @ camera.body_from_optical
        self._eye: Array = level @ np.array(camera.mount)
        self.height = odometry.height + float(self._eye[2])
        """Height of the camera above the ground, metres."""
        if not (np.isfinite(self._rotation).all() and _LOWEST < self.height < math.inf):
            raise ValueError("the camera's attitude or height says nothing")
        self._scale = np.array([camera.width / detections.width, camera.height / detections.height])
        self._centre = np.array([camera.cx, camera.cy])
        self._focal = np.array([camera.fx, camera.fy])
        self._corners = np.array(
            [
                [0, 0],
                [detections.width, 0],
                [detections.width, detections.height],
                [0, detections.height],
            ],
            dtype=np.float64,
        )

    def points(self, pixels: Array, up: float = 0.0) -> Array:
        """Ground points (N, 2) below objects `up` metres high at the pixels (N, 2).

        NaN at and above the horizon; `up` must be less than the camera's height.
        """
        rays = self._rays(pixels)
        down = -rays[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(down > 0, (self.height - up) / down, np.nan)
        return np.asarray(self._eye[:2] + reach[:, None] * rays[:, :2])

    def height_above(self, point: Array, pixel: Array) -> float:
        """Height in metres of the object at `pixel` (2,), if it is above ground `point` (2,)."""
        (ray,) = self._rays(pixel[None])
        away = float(np.hypot(*(point - self._eye[:2])))
        return self.height + away * float(ray[2] / max(np.hypot(*ray[:2]), _STEEPEST))

    def sees(self, point: Array) -> bool:
        """Whether `point` (3,), forward, left and up from the ground below, is in the image."""
        eye = np.array([*self._eye[:2], self.height])
        across, down, depth = self._rotation.T @ (point - eye)
        if depth <= 0:
            return False
        pixel = (self._focal * (across, down) / depth + self._centre) / self._scale
        return bool(((pixel >= 0) & (pixel <= self._corners[2])).all())

    def area(self, farthest: float) -> float:
        """Area (m²) of ground in the image, within `farthest` metres from below the camera."""
        angles = np.linspace(0.0, math.tau, _CORNERS, endpoint=False)
        # The polygon has the same area as the circle.
        radius = farthest * math.sqrt(math.tau / _CORNERS / math.sin(math.tau / _CORNERS))
        region = radius * np.column_stack([np.cos(angles), np.sin(angles)])
        rays = self._rays(self._corners)
        for first, second in zip(rays, np.roll(rays, -1, axis=0), strict=True):
            inwards = np.cross(first, second)
            region = _clip(region, inwards[:2], -self.height * inwards[2])
        east, north = region.T if len(region) else np.zeros((2, 1))
        return float(abs(east @ np.roll(north, -1) - north @ np.roll(east, -1)) / 2)

    def _rays(self, pixels: Array) -> Array:
        flat = (pixels * self._scale - self._centre) / self._focal
        return np.asarray(np.column_stack([flat, np.ones(len(flat))]) @ self._rotation.T)


def _clip(region: Array, normal: Array, offset: float) -> Array:
    """Keep the part of a convex polygon where normal · point + offset ≥ 0."""
    sides = region @ normal + offset
    kept = []
    for index, here in enumerate(region):
        there = (index + 1) % len(region)
        if sides[index] >= 0:
            kept.append(here)
        if sides[index] * sides[there] < 0:
            share = sides[index] / (sides[index] - sides[there])
            kept.append(here + share * (region[there] - here))
    return np.array(kept).reshape(-1, 2)
