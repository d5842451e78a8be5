"""Speed limit for the approach to people, so that the drone stops in time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.following.target_motion import place_of, seen_from
from aerodaas.geometry.braking import braking_speed
from aerodaas.geometry.frames import Vector
from aerodaas.messages.odometry import Odometry

__all__ = ["ApproachLimit", "closing_speed"]

_AHEAD = 0.7
"""Angle off the direction of flight within which a person is in the path, radians."""
_LONGEST_BLIND = 1.0
"""Longest interval between two frames that is considered, seconds; a target unseen for longer is
lost."""


def closing_speed(gap: float, deceleration: float, reaction_time: float) -> float:
    """Highest safe speed (m/s) towards a person `gap` metres beyond the least safe distance.

    For a positive gap as `braking_speed`. For a negative gap it is negative, so that the drone
    backs away; the slope is 1 / `reaction_time` on both sides of zero. Keeping below it makes
    gap >= 0 a forward invariant (control barrier function: Ames et al., "Control barrier
    functions: theory and applications", ECC 2019).
    """
    return gap / reaction_time if gap < 0.0 else braking_speed(gap, deceleration, reaction_time)


class ApproachLimit:
    """Speed limit by the positions of people in the newest frames, who are assumed to stand still.

    A person walking away may stop at any moment, so their walking allows no higher speed. All
    detected people count, not only the target: identity does not matter to a collision.
    """

    def __init__(self, nearest: float, limits: FollowLimits) -> None:
        """Keep the drone at least `nearest` metres away from people."""
        self.nearest = nearest
        self.limits = limits
        self._places: list[Vector] = []
        self._sightings: list[RelativeTarget] = []
        self._target = False
        """Whether the first of them is the target."""
        self._blind = 0.0
        """Interval between frames in seconds, added to the reaction time, so that a drone with a
        low frame rate keeps farther away. The latency of frames needs no allowance, because people
        are assumed to have stopped at capture."""

    def reset(self) -> None:
        """Discard all sightings."""
        self._places, self._sightings = [], []

    def see(
        self,
        target: RelativeTarget | None,
        others: Iterable[RelativeTarget],
        at_capture: Odometry | None,
        interval: float,
    ) -> None:
        """Store the people in a frame captured `interval` seconds after the last.

        A frame without people keeps their previous positions.
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
        """Highest safe speed in m/s towards `towards`, which moves away at `away` m/s.

        Negative if the drone must back off from the target. A target walking away allows no more
        speed than a standing one, and a drone that gains on it has less room than measured, by the
        airframe's response time. Others in the path stop the drone, but do not drive it back.
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
        """Distance of each person in the path, and whether it is the target."""
        seen = self._sightings
        if now is not None:
            seen = [seen_from(now, (float(x), float(y))) for x, y in self._places]
        for number, one in enumerate(seen):
            off = abs(math.remainder(one.bearing - bearing, math.tau))
            if off <= _AHEAD:
                yield one.distance, self._target and number == 0


def _speed(now: Odometry | None, bearing: float) -> float:
    """Speed of the drone towards `bearing` in m/s; zero if unknown."""
    if now is None or not np.isfinite(now.velocity).all():
        return 0.0
    heading = now.yaw + bearing
    return float(now.velocity[:2] @ (math.cos(heading), math.sin(heading)))
