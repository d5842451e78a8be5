"""The followed target: where it is, how it moves, and whether it stands.

The size of a box gives the distance of an object whose size is known, limited to the point where
the ray through its lower edge meets the ground. A box cut by the image's edge is too small, so
the distance derived from it is an upper bound: the object may be nearer, never farther. Taking
such a bound for the distance would fly the drone into a person so near that the feet are outside
the image, which is the case within 3 m for a level camera like the Tello's.

The target's motion is filtered in the local ENU frame, so that the drone's own motion is not
mistaken for the target's, and the latency from a frame's capture to the command is compensated.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.following.ground_point import EDGE_MARGIN, SMALLEST_SLOPE, reach, slope
from aerodaas.geometry.frames import Vector, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.odometry import Odometry

__all__ = [
    "Observation",
    "RelativeTarget",
    "TargetMotion",
    "TargetSize",
    "Upright",
    "ends_in_picture",
    "place_of",
    "seen_from",
    "sight",
]

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
    """Metres."""
    width: float
    """Metres."""
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
    """Locate an upright object.

    A measured depth gives the distance. Otherwise the height of the box does, if all of it is in
    the image; if its top or bottom is cut off or hidden, by a wall or a car, the width is used as
    well, because such a box is too short and the object nearer than it appears.

    Args:
        detection: Box of the object, in pixels.
        detections: Boxes of its frame, with camera and odometry.
        size: Size of such objects, metres.

    Returns:
        Where it is relative to the drone, or None if the camera is not calibrated or the box
        degenerate.
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

    Args:
        detection: The box, in pixels.
        detections: Boxes of its frame, with its size.
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


_RANGE_NOISE, _SIDE_NOISE = 0.06, 0.02
"""Standard deviations along and across the line of sight, as fractions of the distance."""
_LEAST_NOISE = 0.03
_ACCELERATION = 0.7
"""Standard deviation of a walking person's acceleration, m/s^2."""
_LEAP, _PATIENCE = 2.5, 0.5
"""Gate of a sighting in standard deviations of range, and seconds for which it is applied."""
_NEAREST = 0.1
_FIRST_SPEED = 0.7
"""Standard deviation of a velocity not yet observed, m/s."""


def seen_from(odometry: Odometry, place: tuple[float, float]) -> RelativeTarget:
    """Bearing and distance of a place from a drone.

    Args:
        odometry: Odometry of the drone.
        place: Metres east and north of home.
    """
    way = np.array(place) - odometry.position[:2]
    bearing = math.remainder(math.atan2(way[1], way[0]) - odometry.yaw, math.tau)
    return RelativeTarget(bearing, float(np.hypot(*way)))


def place_of(sighting: RelativeTarget, odometry: Odometry) -> NDArray[np.float64]:
    """Position of a sighting.

    Args:
        sighting: Bearing and distance from the drone.
        odometry: Odometry of the drone at capture.

    Returns:
        Metres east and north of home, (2,).
    """
    heading = odometry.yaw + sighting.bearing
    towards = np.array([math.cos(heading), math.sin(heading)])
    return np.asarray(odometry.position[:2] + sighting.distance * towards)


class TargetMotion:
    """Estimator of the target's position and velocity, east and north."""

    def __init__(self, acceleration: float = _ACCELERATION, speed: float = _FIRST_SPEED) -> None:
        """Set the standard deviations of the target's acceleration (m/s²) and initial speed (m/s).

        With both zero, the target is assumed to be static.
        """
        self.acceleration = acceleration
        """Standard deviation of the target's acceleration, m/s²."""
        self._speed = speed
        self._state: NDArray[np.float64] | None = None
        self._covariance: NDArray[np.float64] = np.zeros((4, 4))
        self._stamp = 0

    @property
    def known(self) -> bool:
        """Whether the target was observed since the last reset."""
        return self._state is not None

    @property
    def place(self) -> tuple[float, float] | None:
        """Last estimated position, metres east and north of home; None before the first."""
        return None if self._state is None else (float(self._state[0]), float(self._state[1]))

    def reset(self) -> None:
        """Discard the estimate."""
        self._state = None

    def leaps(self, sighting: RelativeTarget, odometry: Odometry, stamp: int) -> bool:
        """Whether a sighting is farther away than the target can have moved.

        Such a box shows a part of the target, or a person about to fall. It is accepted if it
        persists.

        Args:
            sighting: The sighting.
            odometry: Odometry of the drone at capture.
            stamp: Mission time of capture, nanoseconds.
        """
        predicted = self.relative_to(odometry, stamp)
        if predicted is None or seconds(stamp - self._stamp) > _PATIENCE:
            return False
        return sighting.distance - predicted[0].distance > _LEAP * _RANGE_NOISE * sighting.distance

    def observe(self, sighting: RelativeTarget, odometry: Odometry, stamp: int) -> None:
        """Update the estimate by a sighting.

        Args:
            sighting: Bearing and distance from the drone.
            odometry: Odometry of the drone at capture.
            stamp: Mission time of capture, nanoseconds.
        """
        heading = odometry.yaw + sighting.bearing
        along = np.array([math.cos(heading), math.sin(heading)])
        across = np.array([-along[1], along[0]])
        place = place_of(sighting, odometry)
        range_sigma = max(_LEAST_NOISE, _RANGE_NOISE * sighting.distance)
        side_sigma = max(_LEAST_NOISE, _SIDE_NOISE * sighting.distance)
        noise = range_sigma**2 * np.outer(along, along) + side_sigma**2 * np.outer(across, across)
        if self._state is None:
            self._state = np.array([*place, 0.0, 0.0])
            self._covariance = np.zeros((4, 4))
            self._covariance[:2, :2] = noise
            self._covariance[2:, 2:] = self._speed**2 * np.eye(2)
        else:
            state, covariance = self._predicted(self._state, seconds(stamp - self._stamp))
            gain = covariance[:, :2] @ np.linalg.inv(covariance[:2, :2] + noise)
            self._state = state + gain @ (place - state[:2])
            self._covariance = covariance - gain @ covariance[:2]
        self._stamp = stamp

    def relative_to(
        self, odometry: Odometry, stamp: int
    ) -> tuple[RelativeTarget, float, float] | None:
        """Predict the target relative to a drone.

        Args:
            odometry: Odometry of the drone.
            stamp: Mission time to predict for, nanoseconds.

        Returns:
            Bearing and distance, and the target's velocity in m/s away from the drone along the
            line of sight and to the left across it; None before the first observation.
        """
        if self._state is None:
            return None
        velocity = self._state[2:]
        place = self._state[:2] + velocity * seconds(stamp - self._stamp)
        found = seen_from(odometry, (float(place[0]), float(place[1])))
        along = (place - odometry.position[:2]) / max(found.distance, _NEAREST)
        away = float(velocity @ along)
        left = float(along[0] * velocity[1] - along[1] * velocity[0])
        return found, away, left

    def spread(self, stamp: int) -> float:
        """Standard deviation of the position predicted for `stamp`, metres; 0 without a target."""
        if self._state is None:
            return 0.0
        _, covariance = self._predicted(self._state, seconds(stamp - self._stamp))
        return float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))

    def _predicted(
        self, state: NDArray[np.float64], dt: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """State and covariance `dt` seconds later."""
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        push = np.vstack([np.eye(2) * dt**2 / 2, np.eye(2) * dt])
        covariance = step @ self._covariance @ step.T + self.acceleration**2 * push @ push.T
        return step @ state, covariance


_SPAN = 0.15
"""Seconds between two compared sightings; shorter spans would measure the noise of boxes."""
_FASTEST, _FASTEST_SHARE = 0.8, 0.3
"""Vertical speed in m/s above which a target falls or gets up, and its increase per metre of
distance, because an attitude error moves distant objects more."""
_KEPT = 8
_LOW = 0.6
"""Fraction of its standing height below which a fallen target is still down."""


class Upright:
    """Tracks the height of the target's upper edge, which shows a fall even without the feet.

    A falling person's chest moves a metre sideways within half a second. A follower that took
    this for walking would fly after it, over the person's feet.
    """

    def __init__(self) -> None:
        """Start without sightings."""
        self._looks: deque[tuple[int, float]] = deque(maxlen=_KEPT)
        self._stood: float | None = None
        """Height before the fall, metres."""

    def reset(self) -> None:
        """Discard the target."""
        self._looks.clear()
        self._stood = None

    def stands(self, top: float, distance: float, stamp: int) -> bool:
        """Add a sighting of the target's upper edge.

        Args:
            top: Height of the edge in metres above home.
            distance: Metres to the target.
            stamp: Mission time of capture, nanoseconds.

        Returns:
            False while the edge moves up or down faster than a walking person's, and after a fall
            until it is up again.
        """
        before = self._before(stamp)
        self._looks.append((stamp, top))
        if before is not None:
            then, height = before
            fastest = max(_FASTEST, _FASTEST_SHARE * distance) * seconds(stamp - then)
            if height - top > fastest and self._stood is None:
                self._stood = height
            if abs(height - top) > fastest:
                return False
        if self._stood is not None and top < _LOW * self._stood:
            return False
        self._stood = None
        return True

    def _before(self, stamp: int) -> tuple[int, float] | None:
        """Newest sighting that is old enough for a comparison."""
        earlier = (look for look in reversed(self._looks) if seconds(stamp - look[0]) >= _SPAN)
        return next(earlier, None)


_FARTHEST = 1000.0
"""Greatest plausible distance in metres; no camera detects a person farther away."""
_FARTHEST_FROM_HOME = 1e5


@dataclass(frozen=True, slots=True)
class Observation:
    """Input of the controller for one frame: target, and odometry at capture and at present."""

    stamp: int
    """Mission time at capture, nanoseconds."""
    sighting: RelativeTarget | None
    """The target, if detected."""
    at_capture: Odometry | None = None
    now: Odometry | None = None
    now_stamp: int | None = None
    others: tuple[RelativeTarget, ...] = ()
    """Everybody and everything else that the drone must not fly into."""
    people: tuple[RelativeTarget, ...] = ()
    """Everybody who is seen, among them the target if that is a person."""
    surfaces: NDArray[np.float64] | None = None
    """Surfaces at the drone's own height, as returned by `clearance.surfaces`."""

    @property
    def pose(self) -> Odometry | None:
        """The newest odometry."""
        return self.now or self.at_capture

    @property
    def pose_stamp(self) -> int:
        """Mission time of the newest odometry, nanoseconds."""
        return max(self.stamp, self.now_stamp or 0) if self.now else self.stamp

    @property
    def latency(self) -> float:
        """Seconds from the frame's capture to the newest odometry."""
        return seconds(self.pose_stamp - self.stamp)

    def without_nonsense(self) -> Observation:
        """Remove sightings and odometry with implausible numbers, which count as not observed."""
        return replace(
            self,
            sighting=self.sighting if _can_be(self.sighting) else None,
            at_capture=self.at_capture if _is_sane(self.at_capture) else None,
            now=self.now if _is_sane(self.now) else None,
            others=tuple(filter(_can_be, self.others)),
            people=tuple(filter(_can_be, self.people)),
        )


def _can_be(sighting: RelativeTarget | None) -> bool:
    return (
        sighting is not None
        and abs(sighting.bearing) <= math.pi
        and 0.0 <= sighting.distance <= _FARTHEST
    )


def _is_sane(odometry: Odometry | None) -> bool:
    return (
        odometry is not None
        and bool((np.abs(odometry.position) <= _FARTHEST_FROM_HOME).all())
        and math.isfinite(odometry.yaw)
    )
