"""The target's motion: learnt from a walk, and unlearnt as soon as the walker stops."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.following.target import RelativeTarget, TargetMotion, seen_from
from aerodaas.messages.odometry import Odometry

STOP = 25


def away_after_stop(looks: int, rate: float = 5.0) -> float:
    """The speed believed so many looks after a walker at 1 m/s stood still."""
    motion = TargetMotion()
    stamps = [round(number / rate * NANOSECONDS) for number in range(STOP + looks + 1)]
    places = [min(number, STOP) / rate for number in range(STOP + looks + 1)]
    states = [Odometry(np.array([place, 0.0, 1.5]), np.zeros(3), 0.0) for place in places]
    for state, stamp in zip(states, stamps, strict=True):
        motion.observe(RelativeTarget(0.0, 2.0), state, stamp)
    found = motion.relative_to(states[-1], stamps[-1])
    assert found is not None
    return found[1]


def test_a_walk_is_learnt() -> None:
    """To the speed, so that it is followed without lag."""
    assert away_after_stop(0) == pytest.approx(1.0, abs=0.1)


def test_a_place_is_seen_as_it_lies() -> None:
    """To the left of a drone that looks north is west."""
    drone = Odometry(np.array([1.0, 0.0, 1.5]), np.zeros(3), np.pi / 2)
    found = seen_from(drone, (-2.0, 0.0))
    assert found.bearing == pytest.approx(np.pi / 2)
    assert found.distance == pytest.approx(3.0)


def test_a_leap_away_is_not_believed_at_once() -> None:
    """Nor for ever: what still seems farther half a second later is farther."""
    motion = TargetMotion()
    drone = Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), 0.0)
    far = RelativeTarget(0.0, 3.0)
    assert not motion.leaps(far, drone, 0)
    motion.observe(RelativeTarget(0.0, 2.0), drone, 0)
    assert motion.leaps(far, drone, NANOSECONDS // 5)
    assert not motion.leaps(RelativeTarget(0.0, 2.2), drone, NANOSECONDS // 5)
    assert not motion.leaps(RelativeTarget(0.0, 1.0), drone, NANOSECONDS // 5)
    assert not motion.leaps(far, drone, NANOSECONDS)
