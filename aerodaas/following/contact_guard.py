"""Guard against contact: gives way to people who come at the drone faster than it can back off.

Somebody who is followed may turn round within a step. The filter that follows a walk smoothly
needs half a second to believe it, so that the guard keeps a filter of its own for each person,
which assumes that people turn and start abruptly. From time to contact, the drone's response and
its braking it decides each frame whether the drone must give way now: back at full speed, and
sideways or above their head, whichever is nearer, where backing off alone would be too late.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.following.target_motion import TargetMotion, place_of
from aerodaas.types.clock import seconds
from aerodaas.types.data import Odometry
from aerodaas.types.geometry import body_to_enu, enu_to_body

__all__ = ["ContactGuard", "room_to_stop"]

_OFTEN = 0.1
"""Seconds between frames for which `FollowLimits.turning` holds."""
_STARTING = 1.0
"""Standard deviation of the speed of a person just detected, m/s."""
_SAME = 1.2
"""Distance in metres between a person's predicted and detected position, at most."""
_MEMORY = 1.0
"""Seconds for which a person out of sight is assumed to go on; who is too near is out of sight."""
_CLOSING = 0.3
"""Speed in m/s from which on a person and the drone close; below, it is noise."""
_PASSES = 0.9
"""Distance in metres from the drone beyond which a person goes past."""
_EARLY = 0.4
"""Metres beyond the least distance by which the drone gives way too early rather than too late."""
_STILL_TURNING = 1.4
"""Factor by which people are assumed to come faster than estimated: the estimate lags."""
_BESIDE = 0.3
"""Angle in radians within which somebody is in a direction."""
_HOLD = 0.8
"""Seconds for which the drone goes on giving way after the last sign of danger."""
_SIDESTEP = 1.5
"""Speed of stepping aside or climbing, m/s."""
_HEAD = 1.9
"""Height of a tall person's head, metres."""


def room_to_stop(closing: float, limits: FollowLimits, delay: float) -> float:
    """Distance in metres lost until a drone and a person closing at `closing` m/s no longer close.

    The drone learns of it after `delay` seconds, answers after `limits.reply`, and accelerates
    away with `limits.evasion`.
    """
    closing = max(0.0, closing)
    return closing * (delay + limits.reply) + closing**2 / (2.0 * limits.evasion)


@dataclass
class _Person:
    motion: TargetMotion
    seen: int
    """Mission time of the last detection, nanoseconds."""


class ContactGuard:
    """Decides when and how to give way to people who come at the drone."""

    def __init__(self, limits: FollowLimits) -> None:
        """Keep `limits.contact` metres from people as far as the drone can."""
        self.limits = limits
        self.evading = False
        """Whether the drone gives way at present."""
        self._people: list[_Person] = []
        self._interval = 0.0
        self._danger_at = 0
        """Mission time of the last sign of danger, nanoseconds."""
        self._back: NDArray[np.float64] = np.zeros(3)
        self._aside: NDArray[np.float64] = np.zeros(3)
        """Velocities (ENU, m/s) back and aside or up, chosen when the drone begins to give way, as
        the direction of who is very near is uncertain."""
        self._steps_aside = False

    def reset(self) -> None:
        """Forget all people."""
        self._people.clear()
        self.evading = self._steps_aside = False

    def see(
        self,
        people: Iterable[RelativeTarget],
        at_capture: Odometry | None,
        stamp: int,
        interval: float,
    ) -> None:
        """Add the people in a frame captured at `stamp`, `interval` seconds after the last."""
        self._interval = interval
        pose = at_capture or _STILL
        self._people = [one for one in self._people if seconds(stamp - one.seen) <= _MEMORY]
        known = list(self._people)
        for sighting in sorted(people, key=lambda one: one.distance):
            person = _nearest(known, sighting, pose, stamp)
            if person is None:
                person = _Person(TargetMotion(self._turning(), _STARTING), stamp)
                self._people.append(person)
            else:
                known.remove(person)
            person.seen = stamp
            if not (sighting.bound and _is_nearer(person.motion, sighting, pose, stamp)):
                person.motion.observe(sighting, pose, stamp)

    def evade(self, now: Odometry | None, stamp: int) -> NDArray[np.float64] | None:
        """Velocity (forward, left, up in m/s) by which to give way now; None if there is no need.

        `stamp` is the time of the drone's odometry `now`.
        """
        pose = now or _STILL
        dangers = [self._danger(person.motion, pose, stamp) for person in self._people]
        danger = min(filter(None, dangers), key=lambda one: one.rest, default=None)
        if danger is not None:
            if not self.evading:
                self._choose(danger, pose)
            self._danger_at = stamp
            self._steps_aside |= danger.rest < self.limits.contact + _EARLY / 2
        elif seconds(stamp - self._danger_at) > _HOLD:
            self.evading = self._steps_aside = False
        if not self.evading:
            return None
        return enu_to_body(self._back + (self._aside if self._steps_aside else 0.0), pose.yaw)

    def away(self, bearing: float, now: Odometry | None, stamp: int) -> float:
        """Least speed in m/s at which anybody in a direction goes away; infinite without them.

        Believed at once, so that the drone brakes before it is sure that somebody turns round.
        """
        found = (one.motion.relative_to(now or _STILL, stamp) for one in self._people)
        speeds = (
            away
            for seen, away, _ in filter(None, found)
            if abs(math.remainder(seen.bearing - bearing, math.tau)) < _BESIDE
        )
        return min(speeds, default=math.inf)

    def _danger(self, motion: TargetMotion, pose: Odometry, stamp: int) -> _Danger | None:
        """Who comes so near that the drone must give way before the next frame."""
        predicted = motion.relative_to(pose, stamp)
        if predicted is None:
            return None
        found, away, left = predicted
        ahead = np.array([math.cos(found.bearing), math.sin(found.bearing)])
        flying = _level_velocity(pose)
        towards = float(flying @ ahead)
        sideways = float(flying @ (-ahead[1], ahead[0]))
        closing = _STILL_TURNING * (towards - away)
        if closing < _CLOSING or _passes(found.distance, away - towards, left - sideways):
            return None
        rest = found.distance - room_to_stop(closing, self.limits, 0.0)
        if rest - self._interval * closing > self.limits.contact + _EARLY:
            return None
        return _Danger(rest, ahead, left - sideways)

    def _turning(self) -> float:
        """Standard deviation of accelerations; less where two frames alone tell a speed."""
        return self.limits.turning * math.sqrt(min(1.0, _OFTEN / max(self._interval, _OFTEN)))

    def _choose(self, danger: _Danger, pose: Odometry) -> None:
        """Choose where to give way to: back, and the shorter way out of the person's path."""
        self.evading = True
        ahead = danger.ahead
        self._back = body_to_enu(np.array([*(-self.limits.backward * ahead), 0.0]), pose.yaw)
        aside = np.array([0.0, 0.0, _SIDESTEP])
        if _HEAD - pose.height > 0.0:
            side = -1.0 if danger.left > 0.0 else 1.0
            aside = side * _SIDESTEP * np.array([-ahead[1], ahead[0], 0.0])
        self._aside = body_to_enu(aside, pose.yaw)


@dataclass
class _Danger:
    rest: float
    """Distance in metres that would be left if the drone gave way now."""
    ahead: NDArray[np.float64]
    """Direction of the person (forward, left), a unit vector."""
    left: float
    """Speed of the person to the left across that direction, in relation to the drone, m/s."""


_STILL = Odometry(np.zeros(3), np.zeros(3), 0.0)
"""Pose of a drone without odometry, from which people move as they do in relation to it."""


def _level_velocity(pose: Odometry) -> NDArray[np.float64]:
    """Velocity (forward, left) in m/s; zero if unknown."""
    if not np.isfinite(pose.velocity).all():
        return np.zeros(2)
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.array([[c, s], [-s, c]]) @ pose.velocity[:2]


def _passes(distance: float, away: float, left: float) -> bool:
    """Whether who goes on like this stays clear of the drone; velocities are relative, m/s."""
    return away < 0.0 and distance * abs(left) > _PASSES * math.hypot(away, left)


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


def _is_nearer(motion: TargetMotion, sighting: RelativeTarget, pose: Odometry, stamp: int) -> bool:
    """Whether a person is predicted nearer than the upper bound that a cut box gives."""
    predicted = motion.relative_to(pose, stamp)
    return predicted is not None and predicted[0].distance <= sighting.distance
