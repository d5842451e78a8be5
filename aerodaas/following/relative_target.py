"""Where a detected object of known size stands, seen from a level drone.

The size of a box tells the distance of an object whose size is known, never beyond where the ray
through its lower edge meets the ground. A box that the picture's edge cuts is too small, so that
the distance read from it is an upper bound: the object may stand nearer, never farther. Taking such
a bound for the distance would fly the drone into a person who stands so near that the feet are out
of the picture, which with a level camera of the Tello's kind is so within 3 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerodaas.types.data import Detection, Detections
from aerodaas.types.geometry import Vector, rotation_from_rpy

__all__ = ["RelativeTarget", "TargetSize", "ends_in_picture", "sight"]

_MARGIN = 0.03
"""Part of the picture's side within which a box counts as cut: boxes of people whose feet are out
of the picture end up to 18 of 720 pixels short of its edge (three YOLO models, 36 real frames)."""
_HIDDEN = 1.3
"""Where height and width disagree by more than this, part of the height must be hidden."""
_LIES = 0.8
"""A box that meets the ground this much nearer than its size says is of somebody who lies there:
whoever gets up again may do so nearer than what is seen of them, as feet stand before a chest."""
_AFLOAT, _TILTED = 1.5, 0.05
"""What is afloat meets the ground so many times farther than its size says, and by more than an
attitude that is 3 degrees wrong would make it."""
_TWICE = 2.0
"""What is so many times farther than its size says is no large target, but what lies behind it,
and what is so many times nearer, all of it in the picture, something that passes in between."""
_SMALLEST_SLOPE = 1e-3
_NARROWEST, _WIDEST = 0.6, 1.6


@dataclass(frozen=True, slots=True)
class TargetSize:
    """Height and width of an object in metres; of the two, the height varies less."""

    height: float
    width: float
    widest: float | None = None
    """Where the width is another from another side, as a car's is: the greatest, in metres."""

    def with_width(self, width: float) -> TargetSize:
        """The same with a width that was measured, kept within reason of the one assumed here."""
        most = max(_WIDEST * self.width, self.widest or 0.0)
        bounded = min(max(width, _NARROWEST * self.width), most)
        return TargetSize(self.height, bounded, self.widest)


@dataclass(frozen=True, slots=True)
class RelativeTarget:
    """One look at the target, in the level body frame (FLU without roll and pitch)."""

    bearing: float
    """Radians, positive to the left."""
    distance: float
    """Metres along the ground from the body's centre."""
    bound: bool = False
    """It stands at `distance` or nearer: the picture's edges cut it on all measures, or it lies."""
    width: float | None = None
    """The target's width in metres, where the whole of it was seen."""
    afloat: bool = False
    """Its size says that it is far nearer than where the ground lies below it: it stands on none,
    or is larger than assumed."""
    top: float | None = None
    """Metres from home up to its upper edge, where that is in the picture."""

    @property
    def offset(self) -> Vector:
        """Forward and left in metres, as an array of shape (2,)."""
        return self.distance * np.array([math.cos(self.bearing), math.sin(self.bearing)])


def sight(detection: Detection, detections: Detections, size: TargetSize) -> RelativeTarget | None:
    """Locate `detection`, one of `detections`, an upright object of `size`.

    Where its depth was measured, that is the distance to it. Else the height counts where all of
    it is in the picture; where its top or bottom is cut off or hidden, by a wall or a car, the
    width stands in, for such a box is too short and the object nearer than it seems. None if the
    camera is not calibrated or the box says nothing.
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

    slopes = _slope(ray(u, top)) - _slope(ray(u, bottom))
    middle, edge_left, edge_right = ray(u, v), ray(left, v), ray(right, v)
    bearing = math.atan2(middle[1], middle[0])
    spread = math.remainder(_azimuth(edge_left) - _azimuth(edge_right), math.tau)
    if not (slopes > _SMALLEST_SLOPE and _SMALLEST_SLOPE < spread < math.pi):
        return None
    by_height, breadth = size.height / slopes, 2 * math.tan(spread / 2)
    by_width = size.width / breadth
    at_most = max(size.width, size.widest or 0.0) / breadth
    margin_u, margin_v = _MARGIN * detections.width, _MARGIN * detections.height
    cut_v = top < margin_v or bottom > detections.height - margin_v or by_height > _HIDDEN * at_most
    cut_u = left < margin_u or right > detections.width - margin_u
    by_size = by_height if not cut_v else min(by_height, by_width)
    reach = _reach(ray(u, bottom), lens)
    lies = reach < _LIES * by_height
    depth = _along_ground(detection.depth, middle, level @ camera.body_from_optical[:, 2])
    if depth is not None and not (
        (0.0 if cut_u or cut_v else by_size / _TWICE) <= depth <= by_size * _TWICE
    ):
        depth = None
    measured = min(by_size, reach) if depth is None else depth
    crown = None
    if math.isfinite(lens) and top >= margin_v:
        crown = lens + measured * _slope(ray(u, top))
    direction = np.array([math.cos(bearing), math.sin(bearing)])
    # From the lens to the body's centre.
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
    """Whether a box has a side or its lower edge in the picture.

    What leaves it on the left, on the right and below may be the ground before the camera, of which
    a detector sees no more than of a thing as near as that.
    """
    left, _, right, bottom = detection.box
    margin_u, margin_v = _MARGIN * detections.width, _MARGIN * detections.height
    return (
        left >= margin_u
        or right <= detections.width - margin_u
        or bottom <= detections.height - margin_v
    )


def _along_ground(depth: float | None, ray: Vector, axis: Vector) -> float | None:
    """Metres along the ground, from the lens, to where `ray` is `depth` metres along `axis`.

    None where nothing was measured. Ray and axis are unit vectors of the level frame.
    """
    towards = float(ray @ axis)
    if depth is None or not (math.isfinite(depth) and depth > 0.0 and towards > 0.0):
        return None
    return depth / towards * math.hypot(ray[0], ray[1])


def _reach(lowest: Vector, lens: float) -> float:
    """Metres from the lens, `lens` metres up, to where the ray through a box's lower edge ends.

    Nothing stands below the ground, so no target is farther: one that lies there looks small, which
    its size alone would take for far away. Where the ground falls off the target is only thought
    nearer than it is; infinite where the height is not known or the ray does not go down.
    """
    slope = _slope(lowest)
    if not (math.isfinite(lens) and lens > 0.0 and slope < -_SMALLEST_SLOPE):
        return math.inf
    return -lens / slope


def _is_afloat(lowest: Vector, distance: float, lens: float) -> bool:
    """Tell whether what is `distance` away has its lower edge, along `lowest`, above the ground."""
    if not (math.isfinite(lens) and lens > 0.0 and distance > 0.0):
        return False
    ground, edge = -lens / distance, _slope(lowest)
    return edge > ground / _AFLOAT and edge > ground + _TILTED


def _azimuth(ray: Vector) -> float:
    return math.atan2(ray[1], ray[0])


def _slope(ray: Vector) -> float:
    """Metres up for each metre along the ground."""
    return float(ray[2] / max(math.hypot(ray[0], ray[1]), _SMALLEST_SLOPE))
