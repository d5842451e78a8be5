"""Multi-object tracking: persistent identities through misses, crossings and occlusions.

Each target has a Kalman filter of its box, and people have an appearance. Targets and detections
are associated in order of likelihood by both (greedy global nearest neighbour), so that a new,
uncertain track does not take the detection of an established one. Detections of low score may only
continue a track, after those of high score (ByteTrack, Zhang et al. 2022). The optimal assignment
differs from this only in crowds, and would need scipy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.detection.box_filter import BoxFilter
from aerodaas.analytics.detection.looks import Looks, touches
from aerodaas.clock import seconds
from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections

__all__ = ["Track", "Tracker", "TrackingAnalytics"]

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
    looks: Looks = field(default_factory=Looks)


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

    def __init__(self, *, max_age: float = 1.0, min_hits: int = 2) -> None:
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
