"""Guard against contact: gives way to people who come at the drone faster than it can back off.

Each frame it predicts how near people come if the drone backs off one frame later. If that is too
near, the drone gives way now: back if that leaves enough room, otherwise by whichever of a few
manoeuvres leaves most. All of it is reckoned in the local ENU frame; bearings are turned into
directions there once, and the velocity to fly into the body frame once.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.target import RelativeTarget, TargetMotion
from aerodaas.geometry.frames import Vector, enu_to_body
from aerodaas.messages.odometry import Odometry

__all__ = ["ContactGuard", "PeopleTracker", "Prediction"]

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
        """Add the people in a frame.

        The target claims its person first, whom no other sighting moves: a loose box around a body
        often looks nearer than the body. Then each, nearest first, is the person predicted nearest
        to it, or a new one.

        Args:
            people: Everybody in the frame.
            pose: Odometry of the drone at capture.
            stamp: Mission time of capture, nanoseconds.
            interval: Seconds since the last frame.
            target: That one of `people` who is followed, known by other evidence than its place.
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
        """Everybody surely there, predicted relative to the drone, nearest first.

        Args:
            pose: Odometry of the drone.
            stamp: Mission time to predict for, nanoseconds.
        """
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


_EARLY = 0.3
"""Metres beyond the least distance by which the drone gives way too early rather than too late."""
_CLOSING = 0.3
"""Speed in m/s from which on a person and the drone close; below, it is noise."""
_COMES = 0.9
"""Speed in m/s towards the drone from which on the one who is followed comes back, which is told:
the estimate of somebody who stops within a step swings that far, and the drone gives way, silently.
"""
_STILL_TURNING = 0.4
"""Fraction of their closing speed by which people are assumed to come faster than estimated, as
the estimate lags behind a turn."""
_FAR = 4.0
"""Metres beyond which somebody must seem to come in two frames in a row before the drone gives way:
a box that is too high for one frame looks like a sprint, and there the drone can wait for one."""
_HOLD = 0.8
"""Seconds for which the drone goes on giving way after the last danger, while that person comes."""
_CLEARLY = 0.15
"""Metres that another manoeuvre must leave more than the one begun to replace it."""
_TURNS = tuple(math.radians(angle) for angle in (45.0, -45.0))
"""Angles to the left of straight back by which the drone may give way, radians."""
_CLIMB = 1.5
"""Speed of climbing out of the way, m/s."""
_HEAD = 1.9
"""Height of a tall person's head in metres; a drone above it may climb out of the way."""
_TIMES: NDArray[np.float64] = np.arange(0.0, 2.01, 0.05)
"""Times from now for which distances are predicted, seconds."""
_STILL = Odometry(np.zeros(3), np.zeros(3), 0.0)
"""Pose of a drone without odometry, from which people move as they do in relation to it."""

_Walk: TypeAlias = tuple[Vector, Vector]
"""A person's position and velocity in the local ENU frame; their z is 0."""


class ContactGuard:
    """Decides when and how to give way to people who come at the drone."""

    def __init__(self, limits: FollowLimits) -> None:
        """Keep `limits.contact` metres from people as far as the drone can."""
        self.limits = limits
        self._people = PeopleTracker()
        self._interval = 0.0
        self._velocity: Vector | None = None
        """Velocity at which the drone gives way (ENU, m/s); None if it does not."""
        self._danger_at = 0
        """Mission time of the last sign of danger, nanoseconds."""
        self._danger_of: int | None = None
        """Number of the person of whom it was."""
        self._doubted = False
        """Whether the last frame showed a danger beyond `_FAR`."""
        self._comes = False
        """Whether whom the drone gives way to comes at it."""

    @property
    def evading(self) -> bool:
        """Whether the drone gives way at present."""
        return self._velocity is not None

    @property
    def alarming(self) -> bool:
        """Whether it gives way to somebody who comes, not to a target that only stops."""
        return self.evading and self._comes

    def reset(self) -> None:
        """Forget all people."""
        self._people.reset()
        self._velocity = None
        self._doubted = self._comes = False

    def see(
        self,
        people: Iterable[RelativeTarget],
        at_capture: Odometry | None,
        stamp: int,
        interval: float,
        *,
        target: RelativeTarget | None = None,
    ) -> None:
        """Add the people in a frame.

        Args:
            people: Everybody in the frame.
            at_capture: Odometry of the drone at capture; None if unknown.
            stamp: Mission time of capture, nanoseconds.
            interval: Seconds since the last frame.
            target: That one of `people` who is followed.
        """
        self._interval = interval
        self._people.see(people, at_capture or _STILL, stamp, interval, target=target)

    def evade(self, now: Odometry | None, stamp: int) -> Vector | None:
        """Velocity by which to give way now.

        Args:
            now: Newest odometry of the drone; None if unknown.
            stamp: Mission time of `now`, nanoseconds.

        Returns:
            Forward, left and up in m/s; None if there is no need.
        """
        pose = now or _STILL
        people = self._people.relative_to(pose, stamp)
        walks, danger = self._walks(people, pose)
        doubted, self._doubted = self._doubted, danger is not None and danger.place.distance > _FAR
        if self._doubted and not (doubted or self.evading):
            danger = None
        # Somebody else may come from far away.
        comes = any(one.away < -_CLOSING for one in people if one.number == self._danger_of)
        if danger is not None:
            self._velocity = self._choose(_towards(danger, pose), walks, pose)
            self._danger_at, self._danger_of = stamp, danger.number
            self._comes |= not danger.followed or danger.away < -_COMES
        elif not comes or seconds(stamp - self._danger_at) > _HOLD:
            self._velocity, self._comes = None, False
        return None if self._velocity is None else enu_to_body(self._velocity, pose.yaw)

    def away(self, now: Odometry | None, stamp: int) -> float:
        """Speed at which who is followed goes away.

        Believed at once, so that the drone brakes before it is sure that they turn round.

        Args:
            now: Newest odometry of the drone; None if unknown.
            stamp: Mission time of `now`, nanoseconds.

        Returns:
            Metres per second; infinite while they are not seen.
        """
        people = self._people.relative_to(now or _STILL, stamp)
        return min((one.away for one in people if one.followed and one.in_sight), default=math.inf)

    def headway(self, pace: float, delay: float) -> float:
        """Distance from which a drone that follows somebody can back off.

        They may turn round within a step and come back as fast.

        Args:
            pace: Their speed in m/s; counted up to the limit `forward`.
            delay: Seconds until the drone learns that they have turned round.

        Returns:
            Metres.
        """
        closing = 2.0 * max(0.0, min(pace, self.limits.forward))
        flown_on = closing * (delay + self.limits.reply)
        return self.limits.contact + flown_on + closing**2 / (2.0 * self.limits.evasion)

    def _walks(
        self, people: Iterable[Prediction], pose: Odometry
    ) -> tuple[list[_Walk], Prediction | None]:
        """How everybody walks, and the nearest person whom backing off will not avoid."""
        walks, danger = [], None
        flying = _velocity(pose)
        for one in people:
            ahead = _towards(one, pose)
            aside = np.array([-ahead[1], ahead[0], 0.0])
            closing = float(flying @ ahead) - one.away
            come = (one.away - _STILL_TURNING * max(0.0, closing)) * ahead + one.left * aside
            place = np.array([*pose.position[:2], 0.0]) + one.place.distance * ahead
            walks.append((place, come))
            # The approach keeps away from who is followed and stands.
            comes = one.away < -_CLOSING or not one.followed
            if danger is None and comes and closing > _CLOSING:
                left_over = self._room(-self.limits.backward * ahead, [walks[-1]], pose, late=True)
                if left_over < self.limits.contact + _EARLY:
                    danger = one
        return walks, danger

    def _choose(self, ahead: Vector, walks: Sequence[_Walk], pose: Odometry) -> Vector:
        """Velocity (ENU) by which to give way to somebody in the direction `ahead`."""
        back, side = -self.limits.backward * ahead, self.limits.forward
        aside = side * np.array([-ahead[1], ahead[0], 0.0])
        ways = [back, *(math.cos(turn) * back + math.sin(turn) * aside for turn in _TURNS)]
        if pose.height > _HEAD:
            ways.append(back + np.array([0.0, 0.0, _CLIMB]))
        rooms = [self._room(way, walks, pose) for way in ways]
        if self._velocity is not None:
            begun = self._room(self._velocity, walks, pose)
            return self._velocity if max(rooms) < begun + _CLEARLY else ways[int(np.argmax(rooms))]
        enough = rooms[0] > self.limits.contact + _EARLY
        return back if enough else ways[int(np.argmax(rooms))]

    def _room(
        self, way: Vector, walks: Sequence[_Walk], pose: Odometry, *, late: bool = False
    ) -> float:
        """Least distance in metres to anybody if the drone flies `way` (ENU, m/s) from now on.

        Or `late`, from the next frame on. It answers after `limits.reply` and then accelerates
        straight to that velocity by `limits.evasion`.
        """
        limits, start = self.limits, _velocity(pose)
        change = way - start
        size = float(np.linalg.norm(change))
        lasts = size / limits.evasion
        since = np.maximum(0.0, _TIMES - limits.reply - (self._interval if late else 0.0))
        ramp = np.minimum(since, lasts)
        moved = (ramp**2 / 2.0 + lasts * (since - ramp)) * limits.evasion
        path = pose.position + np.outer(_TIMES, start) + np.outer(moved, change / max(size, 1e-9))
        path[:, 2] = np.maximum(0.0, path[:, 2] - _HEAD)
        rooms = [
            np.linalg.norm(path - place - np.outer(_TIMES, walk), axis=1).min()
            for place, walk in walks
        ]
        return float(min(rooms, default=math.inf))


def _towards(person: Prediction, pose: Odometry) -> Vector:
    """Direction (ENU) of a person from the drone, along the ground."""
    heading = pose.yaw + person.place.bearing
    return np.array([math.cos(heading), math.sin(heading), 0.0])


def _velocity(pose: Odometry) -> Vector:
    """Velocity over the ground (ENU, m/s); zero if unknown."""
    if not np.isfinite(pose.velocity).all():
        return np.zeros(3)
    return np.array([pose.velocity[0], pose.velocity[1], 0.0])
