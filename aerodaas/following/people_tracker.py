"""Tracker of everybody near the drone: where they are and how they walk, believed at once.

Somebody may turn round within a step. The filter that follows a walk smoothly needs half a second
to believe it, so each person has a filter here that expects abrupt turns and starts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from aerodaas.following.relative_target import RelativeTarget
from aerodaas.following.target_motion import TargetMotion, place_of
from aerodaas.types.clock import seconds
from aerodaas.types.data import Odometry

__all__ = ["PeopleTracker", "Prediction"]

Prediction: TypeAlias = tuple[RelativeTarget, float, float]
"""Bearing and distance of a person, and their velocity away along the line of sight and to the left
across it, m/s."""

_SWERVE = 0.8
"""Standard deviation of the change of a person's speed from one frame to the next, m/s; somebody
who walks at 1 m/s and turns round within a step is believed after two frames."""
_SHORTEST = 0.1
"""Shortest interval between frames that is considered, seconds: at higher rates, noise would be
taken for turns."""
_STARTING = 1.0
"""Standard deviation of the speed of a person just detected, m/s."""
_SAME = 1.2
"""Distance in metres between a person's predicted and detected position, at most."""
_MEMORY = 1.0
"""Seconds for which a person out of sight is assumed to go on; who is too near is out of sight."""
_LOOKS = 3
"""Number of frames in a row that must show somebody new, as a detector's false and loose boxes of
people last a frame or two."""


@dataclass
class _Person:
    motion: TargetMotion
    seen: int
    """Mission time of the last detection, nanoseconds."""
    looks: int = 0
    """Number of frames that showed them."""

    @property
    def sure(self) -> bool:
        """Whether enough frames showed them."""
        return self.looks >= _LOOKS


class PeopleTracker:
    """Estimates positions and velocities of people in the local ENU frame."""

    def __init__(self) -> None:
        """Start without people."""
        self._people: list[_Person] = []
        self._newest = 0
        """Mission time of the newest frame, nanoseconds."""

    def reset(self) -> None:
        """Forget all people."""
        self._people.clear()

    def see(
        self, people: Iterable[RelativeTarget], pose: Odometry, stamp: int, interval: float
    ) -> None:
        """Add the people in a frame captured from `pose` at `stamp`, `interval` s after the last.

        A person is the one predicted nearest to the sighting, or a new one. An upper bound of the
        distance is no evidence against somebody predicted nearer.
        """
        last, self._newest = self._newest, stamp
        self._people = [
            one
            for one in self._people
            if seconds(stamp - one.seen) <= _MEMORY and (one.sure or one.seen == last)
        ]
        known = list(self._people)
        turning = _SWERVE / max(interval, _SHORTEST)
        for sighting in sorted(people, key=lambda one: one.distance):
            person = _nearest(known, sighting, pose, stamp)
            if person is None:
                person = _Person(TargetMotion(turning, _STARTING), stamp)
                self._people.append(person)
            else:
                known.remove(person)
            person.seen, person.motion.acceleration = stamp, turning
            person.looks += 1
            predicted = person.motion.relative_to(pose, stamp)
            nearer = predicted is not None and predicted[0].distance <= sighting.distance
            if not (sighting.bound and nearer):
                person.motion.observe(sighting, pose, stamp)

    def relative_to(
        self, pose: Odometry, stamp: int, *, in_sight: bool = False
    ) -> list[Prediction]:
        """Everybody surely there, predicted for `stamp` relative to `pose`, nearest first.

        Or everybody `in_sight`, seen in the newest frame.
        """
        sure = (one for one in self._people if one.sure)
        people = [one for one in sure if one.seen == self._newest or not in_sight]
        found = (person.motion.relative_to(pose, stamp) for person in people)
        return sorted(filter(None, found), key=lambda one: one[0].distance)


def _nearest(
    known: list[_Person], sighting: RelativeTarget, pose: Odometry, stamp: int
) -> _Person | None:
    """Find whom a sighting shows, among those not yet seen in this frame."""
    place = place_of(sighting, pose)
    best, least = None, _SAME
    for person in known:
        predicted = person.motion.relative_to(pose, stamp)
        if predicted is not None:
            off = float(np.linalg.norm(place_of(predicted[0], pose) - place))
            if off <= least:
                best, least = person, off
    return best
