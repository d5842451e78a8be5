"""How fast a drone may come near whom it follows: so that it stops in time, come what may."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from aerodaas.data import Odometry
from aerodaas.geometry import Vector
from aerodaas.navigation.control import braking_speed
from aerodaas.navigation.follow_settings import FollowLimits
from aerodaas.navigation.sighting import Sighting

__all__ = ["ApproachLimit", "closing_speed"]

_AHEAD = 0.7
"""Radians off the drone's way within which somebody stands in it."""


def closing_speed(gap: float, deceleration: float, reaction_time: float) -> float:
    """The highest speed (m/s) towards somebody `gap` metres beyond the least safe distance.

    As `braking_speed` where there is room. Where there is none it is negative, so that the drone
    backs away; the slope is 1 / `reaction_time` on both sides of zero. Keeping below it makes
    gap >= 0 a forward invariant (control barrier function: Ames et al., "Control barrier
    functions: theory and applications", ECC 2019).
    """
    return gap / reaction_time if gap < 0.0 else braking_speed(gap, deceleration, reaction_time)


class ApproachLimit:
    """Remembers where people of the newest pictures stood, and takes them to stand there still.

    Whoever walks away may stop at any moment, so that nothing is gained by their walking. All who
    were seen count, not only the target: who it is matters to following, not to a collision.
    """

    def __init__(self, nearest: float, limits: FollowLimits) -> None:
        """Let the drone come no nearer than `nearest` metres."""
        self.nearest = nearest
        self.limits = limits
        self._places: list[Vector] = []
        self._sightings: list[Sighting] = []

    def reset(self) -> None:
        """Forget them all."""
        self._places, self._sightings = [], []

    def see(self, sightings: Iterable[Sighting], at_capture: Odometry | None) -> None:
        """Take in everybody whom one picture shows; one that shows nobody changes nothing."""
        seen = list(sightings)
        if not seen:
            return
        self._sightings, self._places = seen, []
        if at_capture is not None:
            self._places = [_place(one, at_capture) for one in seen]

    def speed(self, towards: Sighting, away: float, now: Odometry | None) -> float:
        """Fastest speed in m/s towards `towards`, which moves away at `away` m/s.

        Negative where the drone must back off. Only its coming nearer counts as motion.
        """
        distances = [towards.distance]
        for place in self._places if now is not None else ():
            assert now is not None  # noqa: S101 - for the type checkers
            way = place - now.position[:2]
            off = math.atan2(way[1], way[0]) - now.yaw - towards.bearing
            if abs(math.remainder(off, math.tau)) <= _AHEAD:
                distances.append(float(np.hypot(*way)))
        if now is None:
            off_way = (abs(one.bearing - towards.bearing) for one in self._sightings)
            pairs = zip(off_way, self._sightings, strict=True)
            distances += [one.distance for off, one in pairs if off <= _AHEAD]
        gap = min(distances) - self.nearest
        limits = self.limits
        return closing_speed(gap, limits.braking, limits.reaction_time) + min(away, 0.0)


def _place(sighting: Sighting, odometry: Odometry) -> Vector:
    heading = odometry.yaw + sighting.bearing
    towards = np.array([math.cos(heading), math.sin(heading)])
    place: Vector = odometry.position[:2] + sighting.distance * towards
    return place
