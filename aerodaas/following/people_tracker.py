"""Tracker of everybody near the drone: where they are and how they walk, believed at once.

Somebody may turn round within a step. The filter that follows a walk smoothly needs half a second
to believe it, so each person has a filter here that expects abrupt turns and starts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from aerodaas.clock import seconds
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.following.target_motion import TargetMotion
from aerodaas.messages.odometry import Odometry

__all__ = ["PeopleTracker", "Prediction"]

_SWERVE = 0.8
"""Standard deviation of the change of the followed person's speed from one frame to the next, m/s;
if they walk at 1 m/s and turn round within a step, they are believed after two frames."""
_DRIFT = 0.3
"""The same of everybody else: they come from farther away, where distances are less sure and there
is more time."""
_FASTEST = 2.5
"""Speed of a run, m/s; whoever seems faster is believed to run, as boxes that change their size
look like a sprint."""
_SHORTEST = 0.1
"""Shortest interval between frames that is considered, seconds: at higher rates, noise would be
taken for turns."""
_STARTING = 1.5
"""Standard deviation of the speed of a person just detected, m/s."""
_SAME = 1.2
"""Distance in metres between a person's predicted and detected position, at most."""
_MEMORY = 1.0
"""Seconds for which a person out of sight is assumed to go on; who is too near is out of sight."""
_LOOKS = 3
"""Number of frames in a row that must show somebody new, as a detector's false and loose boxes of
people last a frame or two."""


class Prediction(NamedTuple):
    """A person at a moment, seen from the drone."""

    number: int
    """The same for the same person, another for everybody else."""
    place: RelativeTarget
    away: float
    """Their speed along the line of sight, m/s."""
    left: float
    """Their speed across it, m/s."""
    followed: bool
    in_sight: bool
    """Whether the newest frame showed them."""


@dataclass(eq=False)
class _Person:
    number: int
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

    def add(self, sighting: RelativeTarget, pose: Odometry, stamp: int) -> None:
        """Believe a sighting; a bound is no evidence against a prediction that is nearer."""
        self.seen = stamp
        self.looks += 1
        predicted = self.motion.relative_to(pose, stamp)
        nearer = predicted is not None and predicted[0].distance <= sighting.distance
        recent = seconds(stamp - self.located) <= _MEMORY
        if not (sighting.bound and nearer and recent):
            self.motion.observe(sighting, pose, stamp)
            self.located = stamp


class PeopleTracker:
    """Estimates positions and velocities of people in the local ENU frame."""

    def __init__(self) -> None:
        """Start without people."""
        self._people: list[_Person] = []
        self._numbers = itertools.count()
        self._followed: _Person | None = None
        """Who is followed, as of the last frame that showed them."""
        self._newest = 0
        """Mission time of the newest frame, nanoseconds."""

    def reset(self) -> None:
        """Forget all people."""
        self._people.clear()
        self._followed = None

    def see(
        self,
        people: Iterable[RelativeTarget],
        pose: Odometry,
        stamp: int,
        interval: float,
        *,
        target: RelativeTarget | None = None,
    ) -> None:
        """Add the people in a frame captured from `pose` at `stamp`, `interval` s after the last.

        `target` is that one of `people` who is followed, known by other evidence than its place. It
        claims its person first, whom no other sighting moves: a loose box around a body often looks
        nearer than the body. Then each, nearest first, is the person predicted nearest to it, or a
        new one.
        """
        last, self._newest = self._newest, stamp
        self._people = [
            one
            for one in self._people
            if seconds(stamp - one.seen) <= _MEMORY and (one.sure or one.seen == last)
        ]
        frame = max(interval, _SHORTEST)
        for person in self._people:
            swerve = _SWERVE if person is self._followed else _DRIFT
            person.motion.acceleration = swerve / frame
        free = list(self._people)
        for sighting in sorted(people, key=lambda one: (one is not target, one.distance)):
            known = self._shown(sighting, free, pose, stamp, followed=sighting is target)
            if known is None and sighting.doubtful:
                continue
            if known is None:
                motion = TargetMotion(_DRIFT / frame, _STARTING)
                person = _Person(next(self._numbers), motion, stamp, stamp)
                self._people.append(person)
            else:
                person = known
                free.remove(person)
            if sighting is target:
                self._followed = person
            person.add(sighting, pose, stamp)

    def _shown(
        self,
        sighting: RelativeTarget,
        free: Sequence[_Person],
        pose: Odometry,
        stamp: int,
        *,
        followed: bool,
    ) -> _Person | None:
        """Find whom of `free` a sighting shows; None for somebody new."""
        mine = self._followed
        offs = {one: off for one in free if (off := _off(one, sighting, pose, stamp)) <= _SAME}
        if followed and mine is not None and mine in offs:
            return mine
        return min((one for one in offs if one is not mine), key=offs.__getitem__, default=None)

    def relative_to(self, pose: Odometry, stamp: int) -> list[Prediction]:
        """Everybody surely there, predicted for `stamp` relative to `pose`, nearest first."""
        found = []
        for person in self._people:
            predicted = person.motion.relative_to(pose, stamp)
            if person.sure and predicted is not None:
                place, away, left = predicted
                share = min(1.0, _FASTEST / max(math.hypot(away, left), _FASTEST))
                in_sight, followed = person.seen == self._newest, person is self._followed
                speeds = share * away, share * left
                found.append(Prediction(person.number, place, *speeds, followed, in_sight))
        return sorted(found, key=lambda one: one.place.distance)


def _off(person: _Person, sighting: RelativeTarget, pose: Odometry, stamp: int) -> float:
    """Distance in metres of a sighting from a person's predicted position."""
    predicted = person.motion.relative_to(pose, stamp)
    return math.inf if predicted is None else math.dist(predicted[0].offset, sighting.offset)
