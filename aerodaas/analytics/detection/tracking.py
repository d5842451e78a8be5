"""Tracking: detections get an identity that lasts through misses, crossings and occlusions.

Each target has a Kalman filter of its box. The nearest pairs of targets and detections are
joined first (greedy global nearest neighbour), by likelihood, so that a young, vague track does
not take the detection of a well-known one. Detections that are unsure may only continue a track,
after the sure ones (ByteTrack, Zhang et al. 2022). The optimal assignment differs from this only in
crowds, and would need scipy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.detection.box_filter import BoxFilter
from aerodaas.types.clock import seconds
from aerodaas.types.data import Detection, Detections

__all__ = ["Track", "Tracker", "TrackingAnalytics"]

_NEWEST = 0.2
"""Weight of the newest look in the score of a track: it stands for about five looks."""
_GATE = 25.0
"""Squared Mahalanobis distance, of four degrees of freedom, that one true box in 20,000 exceeds."""


@dataclass(eq=False)
class Track:
    """One target and what is known of it."""

    id: int
    detection: Detection
    """As last seen."""
    filter: BoxFilter
    score: float
    """Mean confidence of its looks, the newest weighing most."""
    hits: int = 1
    """How often it was seen."""
    age: float = 0.0
    """Seconds since it was last seen."""


class Tracker:
    """Keeps the identity of every target."""

    def __init__(self, *, max_age: float = 1.0, min_hits: int = 2, sure: float = 0.0) -> None:
        """Forget a target unseen for `max_age` seconds; trust it once seen `min_hits` times.

        Detections that score below `sure` continue tracks, but begin none.
        """
        self.max_age = max_age
        self.min_hits = min_hits
        self.sure = sure
        self.tracks: list[Track] = []
        """All that are not lost, those that are out of sight among them."""
        self._stamp: int | None = None
        self._next_id = 1

    def update(self, detections: Detections) -> Detections:
        """Return `detections` with the `track_id` of each that belongs to a trusted target.

        Stamps must not run back; a frame older than the last one gives no identities.
        """
        stamp = detections.header.stamp
        dt = 0.0 if self._stamp is None else seconds(stamp - self._stamp)
        if dt < 0:
            return detections
        self._stamp = stamp
        for track in self.tracks:
            track.filter.predict(dt)
            track.age += dt
        items = [item for item in detections if all(map(math.isfinite, item.box))]
        owners = self._associate(items)
        self.tracks = [track for track in self.tracks if track.age <= self.max_age]
        named = [
            replace(item, track_id=track.id if track and track.hits >= self.min_hits else None)
            for item, track in zip(items, owners, strict=True)
        ]
        return replace(detections, items=tuple(named))

    def find(self, track_id: int | None) -> Track | None:
        """Return the track of this id; None if there is none or it was lost."""
        return next((track for track in self.tracks if track.id == track_id), None)

    def _associate(self, items: Sequence[Detection]) -> list[Track | None]:
        """Give each detection its track: one that is known, or a new one if it is sure."""
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
                    self._next_id, item, BoxFilter(item.box), item.score, hits=0
                )
                self._next_id += 1
                self.tracks.append(track)
            else:
                track.filter.update(item.box)
                track.score += _NEWEST * (item.score - track.score)
            track.detection = replace(item, track_id=track.id)
            track.hits += 1
            track.age = 0.0
        return [owners.get(column) for column in range(len(items))]


class TrackingAnalytics(Analytics[Detections]):
    """Gives the boxes of a detector identities that last."""

    accepts: ClassVar[tuple[type, ...]] = (Detections,)
    produces: ClassVar[type] = Detections

    def __init__(self, *, max_age: float = 1.0, min_hits: int = 2) -> None:
        """Forget a target unseen for `max_age` seconds; trust it once seen `min_hits` times."""
        self.tracker = Tracker(max_age=max_age, min_hits=min_hits)

    def process(self, item: Detections, context: Context) -> Detections:
        """Return the same boxes with their identities."""
        del context
        return self.tracker.update(item)


def _cost(track: Track, item: Detection) -> float | None:
    """Twice the negative log-likelihood of the pair; None if it cannot be the same object."""
    if track.detection.label != item.label:
        return None
    distance, spread = track.filter.distance(item.box)
    return distance + spread if distance < _GATE else None
