"""Where on the ground a detected object stands: the ray through its foot, cut with the ground.

The foot is the middle of the box's lower edge. The ground is the plane of the local frame's zero,
or a terrain. What a ray's error moves its foot by grows with the square of the distance, so each
place comes with the covariance that a pixel's, the attitude's and the position's error give it, to
the first order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import Vector, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections
from aerodaas.terrain.ground import Ground

__all__ = [
    "EDGE_MARGIN",
    "SMALLEST_SLOPE",
    "GroundPoint",
    "GroundView",
    "ground_point",
    "reach",
    "slope",
]

EDGE_MARGIN = 0.03
"""Distance of a box from the image's edge, as a fraction of the side, within which it counts as
cut: boxes of people whose feet are outside the image end up to 18 of 720 pixels short of its edge
(three YOLO models, 36 real frames)."""
SMALLEST_SLOPE = 1e-3
"""Of a ray, below which it counts as level."""
_ATTITUDE = math.radians(1.5)
"""Standard deviation of each angle of the camera, radians: half the error of 3 degrees that is
allowed for where a target's distance is measured."""
_PIXELS = 2.0
"""Standard deviation of a box's edge, pixels of the calibrated picture."""
_LEAST_DIP = math.radians(5.0)
"""Angle below the horizon, radians, from which on a ray's foot is told: there the attitude's error
alone is three tenths of the distance, and above it soon all of it."""
_FARTHEST = 500.0
"""Metres along the ground."""


@dataclass(frozen=True, slots=True)
class GroundPoint:
    """A place on the ground in the local frame, with its uncertainty as an ellipse."""

    east: float
    north: float
    up: float
    """Metres of the ground there above the local frame's zero."""
    major: float
    """Standard deviation along the ellipse's longer axis, metres."""
    minor: float
    """The same along the shorter one."""
    angle: float
    """Direction of the longer axis, radians counter-clockwise from east, -pi/2 to pi/2."""


def ground_point(
    detection: Detection, detections: Detections, ground: Ground | None = None
) -> GroundPoint | None:
    """Locate the foot of `detection`, one of `detections`, on the ground.

    Args:
        detection: What stands on the ground; something in the air is placed far behind itself.
        detections: All of its frame, with the camera and the vehicle's odometry at capture.
        ground: The terrain; None for the plane of the local frame's zero.

    Returns:
        The place; None without calibration or pose, where the picture's lower edge cuts the foot
        off, and where the ray comes within 5 degrees of the horizon or meets no ground within
        500 m.
    """
    camera, odometry = detections.camera, detections.odometry
    left, _, right, bottom = detection.box
    if camera is None or odometry is None or not all(map(math.isfinite, detection.box)):
        return None
    pose = (*odometry.position.tolist(), odometry.roll, odometry.pitch, odometry.yaw)
    known = all(map(math.isfinite, (*pose, odometry.position_sigma)))
    cut = bottom > detections.height * (1.0 - EDGE_MARGIN)
    if cut or not known:
        return None
    u = (left + right) / 2 * camera.width / detections.width
    v = bottom * camera.height / detections.height
    turned = rotation_from_rpy(odometry.roll, odometry.pitch, odometry.yaw)
    lens = odometry.position + turned @ np.array(camera.mount)
    ray = turned @ camera.ray(u, v)
    distance, up = _foot(lens, ray, ground)
    if slope(ray) > -math.tan(_LEAST_DIP) or not distance <= _FARTHEST:
        return None
    east, north = lens[:2] + distance * ray[:2] / max(math.hypot(ray[0], ray[1]), SMALLEST_SLOPE)
    errors = [*(_ATTITUDE * np.cross(axis, ray) for axis in np.eye(3))]
    errors += [
        _PIXELS * (turned @ camera.ray(u + du, v + dv) - ray) for du, dv in ((1.0, 0.0), (0.0, 1.0))
    ]
    along = (lens[2] - up) / -ray[2]
    # An error of the ray moves its foot across the ray, and from there on along it to the ground.
    moves = [along * _onto_ground(error, ray) for error in errors]
    moves += [odometry.position_sigma * _onto_ground(axis, ray) for axis in np.eye(3)]
    return _placed(float(east), float(north), up, np.array(moves))


def _placed(east: float, north: float, up: float, moves: NDArray[np.float64]) -> GroundPoint:
    """A place whose independent errors of one standard deviation are the rows of `moves` (N, 2)."""
    variances, axes = np.linalg.eigh(moves.T @ moves)
    minor, major = np.sqrt(np.maximum(variances, 0.0)).tolist()
    x, y = axes[:, 1].tolist()
    return GroundPoint(east, north, up, major, minor, math.atan(y / x) if x else math.pi / 2)


def _onto_ground(moved: Vector, ray: Vector) -> Vector:
    """Shift `moved` along `ray` to the height zero; east and north of that, shape (2,)."""
    shifted: Vector = moved[:2] - ray[:2] * moved[2] / ray[2]
    return shifted


def _foot(lens: Vector, ray: Vector, ground: Ground | None) -> tuple[float, float]:
    """Distance along the ground to where `ray` meets it, and its height there; infinite for none.

    Over a terrain the first place counts at which the ground is above the ray; ground that is not
    known is not met.
    """
    if ground is None:
        return reach(ray, float(lens[2])), 0.0
    ahead = ray[:2] / max(math.hypot(ray[0], ray[1]), SMALLEST_SLOPE)
    distances = np.linspace(0.0, _FARTHEST, 2 + math.ceil(_FARTHEST / (0.5 * ground.spacing)))
    heights = ground.heights(lens[0] + distances * ahead[0], lens[1] + distances * ahead[1])
    above = lens[2] + slope(ray) * distances - heights
    (below,) = np.nonzero(above <= 0.0)
    if not below.size or below[0] == 0 or not above[below[0] - 1] > 0.0:
        return math.inf, 0.0
    before, after = below[0] - 1, below[0]
    share = above[before] / (above[before] - above[after])
    met = [float(one[before] + share * (one[after] - one[before])) for one in (distances, heights)]
    return met[0], met[1]


def reach(ray: Vector, height: float) -> float:
    """Metres along level ground to where a ray meets it.

    Args:
        ray: Direction in a level frame, its third part up.
        height: Metres of the lens above the ground.

    Returns:
        Metres; infinite if the height is unknown or not positive, or the ray does not point down.
    """
    steep = slope(ray)
    if not (math.isfinite(height) and height > 0.0 and steep < -SMALLEST_SLOPE):
        return math.inf
    return -height / steep


def slope(ray: Vector) -> float:
    """Slope of a ray, metres up per metre along the ground."""
    return float(ray[2] / max(math.hypot(ray[0], ray[1]), SMALLEST_SLOPE))


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
        """Ground points below objects at some pixels.

        Args:
            pixels: Pixels of the picture, (N, 2).
            up: Metres of the objects above the ground, less than the camera's height.

        Returns:
            Metres forward and left, (N, 2); NaN at and above the horizon.
        """
        rays = self._rays(pixels)
        down = -rays[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(down > 0, (self.height - up) / down, np.nan)
        return np.asarray(self._eye[:2] + reach[:, None] * rays[:, :2])

    def height_above(self, point: Array, pixel: Array) -> float:
        """Height in metres of an object above the ground.

        Args:
            point: Ground point below it, (2,), metres forward and left.
            pixel: Pixel at which it is seen, (2,).
        """
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
