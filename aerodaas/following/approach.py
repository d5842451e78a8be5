"""How fast a drone may come near whom it follows: so that it stops in time, come what may."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.following.target_motion import place_of, seen_from
from aerodaas.types.braking import braking_speed
from aerodaas.types.data import Odometry
from aerodaas.types.geometry import Vector

__all__ = ["ApproachLimit", "closing_speed"]

_AHEAD = 0.7
"""Radians off the drone's way within which somebody stands in it."""
_LONGEST_BLIND = 1.0
"""Seconds between two pictures that count; who is not seen for longer is lost."""


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
        self._sightings: list[RelativeTarget] = []
        self._target = False
        """Whether the first of them is the target."""
        self._blind = 0.0
        """Seconds from one picture to the next: added to the reaction time, so that a drone whose
        pictures come seldom keeps farther away. That they come late needs no more, as whoever is
        seen is taken to have stopped when the picture was taken."""

    def reset(self) -> None:
        """Forget them all."""
        self._places, self._sightings = [], []

    def see(
        self,
        target: RelativeTarget | None,
        others: Iterable[RelativeTarget],
        at_capture: Odometry | None,
        interval: float,
    ) -> None:
        """Take in everybody whom a picture shows that was taken `interval` seconds after the last.

        One that shows nobody leaves them where they stood.
        """
        self._blind = min(interval, _LONGEST_BLIND)
        seen = [*([] if target is None else [target]), *others]
        if not seen:
            return
        self._target = target is not None
        self._sightings, self._places = seen, []
        if at_capture is not None:
            self._places = [place_of(one, at_capture) for one in seen]

    def speed(self, towards: RelativeTarget, away: float, now: Odometry | None) -> float:
        """Fastest speed in m/s towards `towards`, which moves away at `away` m/s.

        Negative where the drone must back off from the target. Its walking away allows no more
        speed than its standing still, but a drone that gains on it has less room than it seems: the
        airframe goes on gaining until it has answered. Others in the way stop the drone, but do not
        drive it back.
        """
        seen = list(self._distances(towards.bearing, now))
        target = min([towards.distance, *(far for far, is_target in seen if is_target)])
        target -= self.limits.response * max(0.0, _speed(now, towards.bearing) - max(away, 0.0))
        others = [self._closing(far) for far, is_target in seen if not is_target]
        speed = self._closing(target) + min(away, 0.0)
        return min(speed, max(0.0, min(others))) if others else speed

    def _closing(self, distance: float) -> float:
        reaction_time = self.limits.reaction_time + self._blind
        return closing_speed(distance - self.nearest, self.limits.braking, reaction_time)

    def _distances(self, bearing: float, now: Odometry | None) -> Iterator[tuple[float, bool]]:
        """How far each stands that is in the way, and whether it is the target."""
        seen = self._sightings
        if now is not None:
            seen = [seen_from(now, (float(x), float(y))) for x, y in self._places]
        for number, one in enumerate(seen):
            off = abs(math.remainder(one.bearing - bearing, math.tau))
            if off <= _AHEAD:
                yield one.distance, self._target and number == 0


def _speed(now: Odometry | None, bearing: float) -> float:
    """How fast the drone flies towards `bearing`, in m/s; zero if that is not known."""
    if now is None or not np.isfinite(now.velocity).all():
        return 0.0
    heading = now.yaw + bearing
    return float(now.velocity[:2] @ (math.cos(heading), math.sin(heading)))
