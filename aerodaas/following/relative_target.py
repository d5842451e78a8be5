"""Position of a detected object of known size relative to a level drone.

The size of a box gives the distance of an object whose size is known, limited to the point where
the ray through its lower edge meets the ground. A box cut by the image's edge is too small, so
the distance derived from it is an upper bound: the object may be nearer, never farther. Taking
such a bound for the distance would fly the drone into a person so near that the feet are outside
the image, which is the case within 3 m for a level camera like the Tello's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerodaas.following.ground_point import EDGE_MARGIN, SMALLEST_SLOPE, reach, slope
from aerodaas.geometry.frames import Vector, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections

__all__ = ["RelativeTarget", "TargetSize", "ends_in_picture", "sight"]

_HIDDEN = 1.3
"""Ratio of the distances by height and by width above which part of the height is hidden."""
_LIES = 0.8
"""Ratio of the distance to the ground at the lower edge to the distance by size, below which a
person lies there: they may get up nearer than their visible part, as feet precede a chest."""
_AFLOAT, _TILTED = 1.5, 0.05
"""Ratio of the distance to the ground at the lower edge to the distance by size, above which an
object is afloat, and the least difference in slope, to allow for an attitude error of 3 degrees."""
_TWICE = 2.0
"""Ratio of measured depth to the distance by size, above which the depth is that of the background,
and below whose inverse, for a box entirely in the image, it is that of an object in between."""
_NARROWEST, _WIDEST = 0.6, 1.6


@dataclass(frozen=True, slots=True)
class TargetSize:
    """Height and width of an object in metres; the height varies less than the width."""

    height: float
    width: float
    widest: float | None = None
    """Greatest width in metres, if the width depends on the viewing side, as a car's does."""

    def with_width(self, width: float) -> TargetSize:
        """Replace the width by a measured one, clamped to a plausible range."""
        most = max(_WIDEST * self.width, self.widest or 0.0)
        bounded = min(max(width, _NARROWEST * self.width), most)
        return TargetSize(self.height, bounded, self.widest)


@dataclass(frozen=True, slots=True)
class RelativeTarget:
    """One sighting of the target in the level body frame (FLU without roll and pitch)."""

    bearing: float
    """Direction in radians, positive to the left."""
    distance: float
    """Distance along the ground from the body's centre, metres."""
    bound: bool = False
    """Whether `distance` is an upper bound, because the image's edges cut the box in both
    directions, or the target lies."""
    width: float | None = None
    """Width of the target in metres, if it is entirely in the image."""
    afloat: bool = False
    """Whether the distance by size is much less than that of the ground at its lower edge: the
    object does not stand on the ground, or is larger than assumed."""
    top: float | None = None
    """Height of its upper edge above home in metres, if that is in the image."""
    doubtful: bool = False
    """Whether its box may show somebody who is known by another box."""

    @property
    def offset(self) -> Vector:
        """Forward and left in metres, as an array of shape (2,)."""
        return self.distance * np.array([math.cos(self.bearing), math.sin(self.bearing)])


def sight(detection: Detection, detections: Detections, size: TargetSize) -> RelativeTarget | None:
    """Locate `detection`, one of `detections`, an upright object of `size`.

    A measured depth gives the distance. Otherwise the height of the box does, if all of it is in
    the image; if its top or bottom is cut off or hidden, by a wall or a car, the width is used as
    well, because such a box is too short and the object nearer than it appears. None if the
    camera is not calibrated or the box is degenerate.
    """
    camera, odometry = detections.camera, detections.odometry
    left, top, right, bottom = detection.box
    if camera is None or not all(map(math.isfinite, detection.box)):
        return None
    level = np.eye(3)
    if odometry is not None and math.isfinite(odometry.roll + odometry.pitch):
        level = rotation_from_rpy(odometry.roll, odometry.pitch, 0.0)
    mount = level @ np.array(camera.mount)
    lens = math.inf if odometry is None else odometry.height + float(mount[2])
    scale_u, scale_v = camera.width / detections.width, camera.height / detections.height
    u, v = detection.centre

    def ray(at_u: float, at_v: float) -> Vector:
        towards: Vector = level @ camera.ray(at_u * scale_u, at_v * scale_v)
        return towards

    slopes = slope(ray(u, top)) - slope(ray(u, bottom))
    middle, edge_left, edge_right = ray(u, v), ray(left, v), ray(right, v)
    bearing = math.atan2(middle[1], middle[0])
    spread = math.remainder(_azimuth(edge_left) - _azimuth(edge_right), math.tau)
    if not (slopes > SMALLEST_SLOPE and SMALLEST_SLOPE < spread < math.pi):
        return None
    by_height, breadth = size.height / slopes, 2 * math.tan(spread / 2)
    by_width = size.width / breadth
    at_most = max(size.width, size.widest or 0.0) / breadth
    margin_u, margin_v = EDGE_MARGIN * detections.width, EDGE_MARGIN * detections.height
    cut_v = top < margin_v or bottom > detections.height - margin_v or by_height > _HIDDEN * at_most
    cut_u = left < margin_u or right > detections.width - margin_u
    by_size = by_height if not cut_v else min(by_height, by_width)
    # A lying target appears small and therefore far away by its size. Where the ground falls off,
    # the target is only estimated nearer than it is.
    ends = reach(ray(u, bottom), lens)
    lies = ends < _LIES * by_height
    depth = _along_ground(detection.depth, middle, level @ camera.body_from_optical[:, 2])
    if depth is not None and not (
        (0.0 if cut_u or cut_v else by_size / _TWICE) <= depth <= by_size * _TWICE
    ):
        depth = None
    measured = min(by_size, ends) if depth is None else depth
    crown = None
    if math.isfinite(lens) and top >= margin_v:
        crown = lens + measured * slope(ray(u, top))
    direction = np.array([math.cos(bearing), math.sin(bearing)])
    # Moves the origin from the lens to the body's centre.
    place = measured * direction + mount[:2]
    return RelativeTarget(
        bearing=math.atan2(place[1], place[0]),
        distance=float(np.hypot(*place)),
        bound=lies or (cut_v and cut_u and depth is None),
        width=None if cut_u or cut_v else by_height * breadth,
        afloat=_is_afloat(ray(u, bottom), depth or by_height, lens),
        top=crown,
    )


def ends_in_picture(detection: Detection, detections: Detections) -> bool:
    """Whether a side or the lower edge of a box is in the image.

    A box that extends beyond the left, right and lower edges may be the ground before the camera,
    which a detector cannot distinguish from an object at that distance.
    """
    left, _, right, bottom = detection.box
    margin_u, margin_v = EDGE_MARGIN * detections.width, EDGE_MARGIN * detections.height
    return (
        left >= margin_u
        or right <= detections.width - margin_u
        or bottom <= detections.height - margin_v
    )


def _along_ground(depth: float | None, ray: Vector, axis: Vector) -> float | None:
    """Ground distance in metres from the lens to the point of `ray` with `depth` along `axis`.

    None without a measured depth. Ray and axis are unit vectors of the level frame.
    """
    towards = float(ray @ axis)
    if depth is None or not (math.isfinite(depth) and depth > 0.0 and towards > 0.0):
        return None
    return depth / towards * math.hypot(ray[0], ray[1])


def _is_afloat(lowest: Vector, distance: float, lens: float) -> bool:
    """Whether an object at `distance` has its lower edge, along `lowest`, above the ground."""
    if not (math.isfinite(lens) and lens > 0.0 and distance > 0.0):
        return False
    ground, edge = -lens / distance, slope(lowest)
    return edge > ground / _AFLOAT and edge > ground + _TILTED


def _azimuth(ray: Vector) -> float:
    return math.atan2(ray[1], ray[0])
