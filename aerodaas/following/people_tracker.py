"""Tracker of everybody near the drone: where they are and how they walk, believed at once.

Somebody may turn round within a step. The filter that follows a walk smoothly needs half a second
to believe it, so each person has a filter here that expects abrupt turns and starts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from aerodaas.following.relative_target import RelativeTarget
from aerodaas.following.target_motion import TargetMotion
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


@dataclass(eq=False)
class _Person:
    motion: TargetMotion
    seen: int
    """Mission time of the last detection, nanoseconds."""
    located: int
    """Mission time of the last detection that told a distance, nanoseconds."""
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

        The pairs of a person and a sighting that fit best are the same, the rest are new. An upper
        bound of the distance is no evidence against somebody predicted nearer.
        """
        last, self._newest = self._newest, stamp
        self._people = [
            one
            for one in self._people
            if seconds(stamp - one.seen) <= _MEMORY and (one.sure or one.seen == last)
        ]
        turning = _SWERVE / max(interval, _SHORTEST)
        for person in self._people:
            person.motion.acceleration = turning
        for sighting, known in self._matched(list(people), pose, stamp):
            if known is None and sighting.doubtful:
                continue
            person = known or _Person(TargetMotion(turning, _STARTING), stamp, stamp)
            if known is None:
                self._people.append(person)
            person.seen = stamp
            person.looks += 1
            predicted = person.motion.relative_to(pose, stamp)
            nearer = predicted is not None and predicted[0].distance <= sighting.distance
            recent = seconds(stamp - person.located) <= _MEMORY
            if not (sighting.bound and nearer and recent):
                person.motion.observe(sighting, pose, stamp)
                person.located = stamp

    def _matched(
        self, sightings: Sequence[RelativeTarget], pose: Odometry, stamp: int
    ) -> Iterator[tuple[RelativeTarget, _Person | None]]:
        """Each sighting with the person whom it shows, None for somebody new."""
        fits = sorted(
            (person.motion.surprise(sighting, pose, stamp), number, index)
            for number, sighting in enumerate(sightings)
            for index, person in enumerate(self._people)
            if _off(person, sighting, pose, stamp) <= _SAME
        )
        found: dict[int, int] = {}
        for _, number, index in fits:
            if number not in found and index not in found.values():
                found[number] = index
        matched = {number: self._people[index] for number, index in found.items()}
        for number, sighting in enumerate(sightings):
            yield sighting, matched.get(number)

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


def _off(person: _Person, sighting: RelativeTarget, pose: Odometry, stamp: int) -> float:
    """Distance in metres of a sighting from a person's predicted position."""
    predicted = person.motion.relative_to(pose, stamp)
    return math.inf if predicted is None else math.dist(predicted[0].offset, sighting.offset)
