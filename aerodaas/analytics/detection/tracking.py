"""Multi-object tracking: persistent identities through misses, crossings and occlusions.

Each target has a Kalman filter of its box, and people have an appearance. Targets and detections
are associated in order of likelihood by both (greedy global nearest neighbour), so that a new,
uncertain track does not take the detection of an established one. Detections of low score may only
continue a track, after those of high score (ByteTrack, Zhang et al. 2022). The optimal assignment
differs from this only in crowds, and would need scipy.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.base import Analytics, Context
from aerodaas.clock import seconds
from aerodaas.config.checked import Count, NotNegative
from aerodaas.geometry.frames import Box, rotation_from_rpy
from aerodaas.messages.appearance import unlikeness
from aerodaas.messages.detections import Detection, Detections

__all__ = ["AppearanceHistory", "BoxFilter", "Track", "Tracker", "TrackingAnalytics", "touches"]

Array = NDArray[np.float64]
_MEASUREMENT = 0.08
"""Standard deviation of a detected box, in box heights."""
_FIRST_VELOCITY = 1.0
"""Standard deviation of an unknown velocity, in box heights a second."""
_ACCELERATION = 1.5
"""Standard deviation of the acceleration, in box heights a second squared."""
_SMALLEST = 1.0


class BoxFilter:
    """Estimate of one box, with its covariance."""

    def __init__(self, box: Box) -> None:
        """Initialise at a detected `box` (left, top, right, bottom in pixels), at rest."""
        self.value: Array = _measurement(box)
        self.velocity: Array = np.zeros(4)
        scale = self._scale
        self._variance: Array = np.full(4, (_MEASUREMENT * scale) ** 2)
        self._covariance: Array = np.zeros(4)
        self._velocity_variance: Array = np.full(4, (_FIRST_VELOCITY * scale) ** 2)

    @property
    def box(self) -> Box:
        """Left, top, right, bottom, in pixels."""
        u, v, width, height = self.value.tolist()
        width, height = max(width, _SMALLEST), max(height, _SMALLEST)
        return u - width / 2, v - height / 2, u + width / 2, v + height / 2

    def predict(self, dt: float) -> None:
        """Advance by `dt` seconds, with white noise of acceleration."""
        noise = (_ACCELERATION * self._scale) ** 2
        self.value = self.value + dt * self.velocity
        self._variance = (
            self._variance
            + 2 * dt * self._covariance
            + dt**2 * self._velocity_variance
            + noise * dt**4 / 4
        )
        self._covariance = self._covariance + dt * self._velocity_variance + noise * dt**3 / 2
        self._velocity_variance = self._velocity_variance + noise * dt**2

    def shift(self, u: float, v: float) -> None:
        """Move the estimate, as the camera has turned.

        Args:
            u: Pixels to the right.
            v: Pixels down.
        """
        self.value = self.value + np.array([u, v, 0.0, 0.0])

    def distance(self, box: Box) -> tuple[float, float]:
        """Squared Mahalanobis distance of a detected `box`, and log determinant of the covariance.

        The covariance is that of the innovation.
        """
        spread = self._variance + (_MEASUREMENT * self._scale) ** 2
        innovation = _measurement(box) - self.value
        return float(np.sum(innovation**2 / spread)), float(np.sum(np.log(spread)))

    def update(self, box: Box) -> None:
        """Correct the estimate by a detected `box`."""
        spread = self._variance + (_MEASUREMENT * self._scale) ** 2
        innovation = _measurement(box) - self.value
        gain, velocity_gain = self._variance / spread, self._covariance / spread
        self.value = self.value + gain * innovation
        self.velocity = self.velocity + velocity_gain * innovation
        self._velocity_variance = self._velocity_variance - velocity_gain * self._covariance
        self._covariance = (1 - gain) * self._covariance
        self._variance = (1 - gain) * self._variance

    @property
    def _scale(self) -> float:
        return max(float(self.value[3]), _SMALLEST)


def _measurement(box: Box) -> Array:
    left, top, right, bottom = box
    return np.array([(left + right) / 2, (top + bottom) / 2, right - left, bottom - top])


_REMEMBERED = 12
"""Appearances that are kept."""
_BESIDE = 0.25
"""Part of a box's width on each side that counts as touched: an arm reaches that far."""
_ABOVE = 0.5
"""The same of its height, as the picture tilts with the drone."""


def touches(one: Box, other: Box) -> bool:
    """Whether two boxes overlap, or nearly do.

    Args:
        one: Box in pixels.
        other: The other one.
    """
    beside = _BESIDE * min(one[2] - one[0], other[2] - other[0])
    above = _ABOVE * min(one[3] - one[1], other[3] - other[1])
    across = min(one[2], other[2]) - max(one[0], other[0])
    down = min(one[3], other[3]) - max(one[1], other[1])
    return across > -beside and down > -above


class AppearanceHistory:
    """The newest appearances, oldest first."""

    def __init__(self) -> None:
        """Start without any."""
        self._seen: deque[tuple[int, bytes]] = deque(maxlen=_REMEMBERED)

    def __len__(self) -> int:
        """Count the appearances."""
        return len(self._seen)

    def add(self, stamp: int, appearance: bytes) -> None:
        """Add an appearance.

        Args:
            stamp: Mission time of the frame, nanoseconds.
            appearance: Appearance of a person, as `Detection.appearance`.
        """
        self._seen.append((stamp, appearance))

    def since(self, stamp: int = 0) -> tuple[bytes, ...]:
        """Appearances later than `stamp`."""
        return tuple(appearance for when, appearance in self._seen if when > stamp)

    def unlike(self, appearance: bytes | None) -> float | None:
        """Difference of an appearance from these, as `unlikeness`; None if not comparable."""
        return None if appearance is None else unlikeness(self.since(), (appearance,))


_NEWEST = 0.2
"""Weight of the newest detection in the score of a track, a mean over about five detections."""
_GATE = 25.0
"""Squared Mahalanobis distance, four degrees of freedom, exceeded by 1 in 20,000 true boxes."""
_COLOURS, _UNLIKE = 5.0, 14.0
"""Standard deviation of the unlikeness of one person's appearances from one side, and its gate."""


@dataclass(eq=False)
class Track:
    """Tracking state of one target."""

    id: int
    detection: Detection
    """Its last detection."""
    filter: BoxFilter
    score: float
    """Mean confidence of its detections, weighted towards the newest."""
    born: int = 0
    """Mission time of its first detection, nanoseconds."""
    hits: int = 1
    """Number of its detections."""
    age: float = 0.0
    """Seconds since its last detection."""
    looks: AppearanceHistory = field(default_factory=AppearanceHistory)


class Tracker:
    """Assigns a persistent identity to every target."""

    def __init__(self, *, max_age: float = 1.0, min_hits: int = 2, sure: float = 0.0) -> None:
        """Drop a track undetected for `max_age` seconds; confirm it after `min_hits` detections.

        Detections that score below `sure` continue tracks, but start none.
        """
        self.max_age = max_age
        self.min_hits = min_hits
        self.sure = sure
        self.tracks: list[Track] = []
        """All tracks that are not lost, including those out of sight."""
        self._stamp: int | None = None
        self._attitude: NDArray[np.float64] | None = None
        """Rotation (3, 3) from the body to the local frame at the last frame."""
        self._next_id = 1

    def update(self, detections: Detections) -> Detections:
        """Return `detections` with the `track_id` of each that belongs to a confirmed track.

        A frame older than the last one is returned unchanged.
        """
        stamp = detections.header.stamp
        dt = 0.0 if self._stamp is None else seconds(stamp - self._stamp)
        if dt < 0:
            return detections
        self._stamp = stamp
        for track in self.tracks:
            track.filter.predict(dt)
            track.age += dt
        self._follow_camera(detections)
        items = [item for item in detections if all(map(math.isfinite, item.box))]
        owners = self._associate(items)
        self.tracks = [track for track in self.tracks if track.age <= self.max_age]
        named = [
            replace(item, track_id=track.id if track and track.hits >= self.min_hits else None)
            for item, track in zip(items, owners, strict=True)
        ]
        return replace(detections, items=tuple(named))

    def find(self, track_id: int | None) -> Track | None:
        """Return the track of this id; None if it is unknown or lost."""
        return next((track for track in self.tracks if track.id == track_id), None)

    def _follow_camera(self, detections: Detections) -> None:
        """Move each box to where the camera, if it has turned since the last frame, shows it."""
        before, pose, camera = self._attitude, detections.odometry, detections.camera
        self._attitude = None
        if pose is None or camera is None or not math.isfinite(pose.roll + pose.pitch + pose.yaw):
            return
        self._attitude = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
        if before is None:
            return
        turned = self._attitude.T @ before
        scale_u, scale_v = camera.width / detections.width, camera.height / detections.height
        for track in self.tracks:
            u, v = float(track.filter.value[0]), float(track.filter.value[1])
            towards = turned @ camera.ray(u * scale_u, v * scale_v)
            new_u, new_v, depth = camera.project(towards + np.array(camera.mount))
            if depth > 0.0:
                track.filter.shift(new_u / scale_u - u, new_v / scale_v - v)

    def _associate(self, items: Sequence[Detection]) -> list[Track | None]:
        """Assign each detection an existing track, or a new one if its score suffices."""
        pairs = sorted(
            (item.score < self.sure, cost, row, column)
            for row, track in enumerate(self.tracks)
            for column, item in enumerate(items)
            if (cost := _cost(track, item)) is not None
        )
        owners: dict[int, Track] = {}
        taken: set[int] = set()
        for *_, row, column in pairs:
            if row not in taken and column not in owners:
                taken.add(row)
                owners[column] = self.tracks[row]
        for column, item in enumerate(items):
            track = owners.get(column)
            if track is None and item.score < self.sure:
                continue
            if track is None:
                track = owners[column] = Track(
                    self._next_id, item, BoxFilter(item.box), item.score, self._stamp or 0, hits=0
                )
                self._next_id += 1
                self.tracks.append(track)
            else:
                track.filter.update(item.box)
                track.score += _NEWEST * (item.score - track.score)
            track.detection = replace(item, track_id=track.id)
            track.hits += 1
            track.age = 0.0
            if item.appearance is not None and not _is_touched(item, items):
                track.looks.add(self._stamp or 0, item.appearance)
        return [owners.get(column) for column in range(len(items))]


class TrackingAnalytics(Analytics[Detections]):
    """Adds persistent track ids to the boxes of a detector."""

    accepts: ClassVar[tuple[type, ...]] = (Detections,)
    produces: ClassVar[type] = Detections

    def __init__(self, *, max_age: NotNegative = 1.0, min_hits: Count = 2) -> None:
        """Configure the tracker.

        Args:
            max_age: Seconds without a detection after which a track is dropped.
            min_hits: Number of detections that confirm a track.
        """
        self.tracker = Tracker(max_age=max_age, min_hits=min_hits)

    def process(self, item: Detections, context: Context) -> Detections:
        """Return the same boxes with the track ids of confirmed tracks."""
        del context
        return self.tracker.update(item)


def _is_touched(item: Detection, items: Sequence[Detection]) -> bool:
    """Whether another box with the same label touches this one, and may hide part of it."""
    others = (one for one in items if one is not item and one.label == item.label)
    return any(touches(item.box, one.box) for one in others)


def _cost(track: Track, item: Detection) -> float | None:
    """Twice the negative log-likelihood of the pair, up to a constant; None beyond the gate."""
    if track.detection.label != item.label:
        return None
    distance, spread = track.filter.distance(item.box)
    if distance >= _GATE:
        return None
    unlike = track.looks.unlike(item.appearance)
    if unlike is not None and unlike > _UNLIKE:
        return None
    return distance + spread + (1.0 if unlike is None else (unlike / _COLOURS) ** 2)
