"""The guard against contact: who comes at the drone is given way to, and nobody else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.following.contact_guard import ContactGuard, room_to_stop
from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.types.clock import NANOSECONDS
from aerodaas.types.data import Odometry

LIMITS = FollowLimits()
INTERVAL = 0.1


def pose(height: float = 1.5, forward: float = 0.0, yaw: float = 0.0) -> Odometry:
    """A drone above the origin that flies ahead at `forward` m/s."""
    velocity = forward * np.array([math.cos(yaw), math.sin(yaw), 0.0])
    return Odometry(np.array([0.0, 0.0, height]), velocity, yaw)


def watch(
    guard: ContactGuard, speed: float, until: float, drone: Odometry, aside: float = 0.0
) -> list[np.ndarray | None]:
    """Somebody comes straight ahead from 6 m, `aside` metres to the left, to `until` metres."""
    answers, distance, step = [], 6.0, 0
    while distance > until:
        stamp = round(step * INTERVAL * NANOSECONDS)
        found = RelativeTarget(math.atan2(aside, distance), math.hypot(aside, distance))
        guard.see([found], drone, stamp, INTERVAL)
        answers.append(guard.evade(drone, stamp))
        distance, step = distance - speed * INTERVAL, step + 1
    return answers


@given(closing=st.floats(0.0, 5.0), delay=st.floats(0.0, 0.5))
def test_the_room_to_stop_is_what_is_lost(closing: float, delay: float) -> None:
    """Until the drone answers at full speed, then by its acceleration; none to who goes away."""
    room = room_to_stop(closing, LIMITS, delay)
    assert room >= closing * (delay + LIMITS.reply)
    assert room - closing * (delay + LIMITS.reply) == pytest.approx(closing**2 / 6.0)
    assert room_to_stop(-closing, LIMITS, delay) == 0.0


@pytest.mark.parametrize("speed", [0.7, 1.3, 1.8])
@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_who_comes_is_backed_off_from_at_full_speed(speed: float, yaw: float) -> None:
    """Not from afar, but while there is room to stop."""
    guard = ContactGuard(LIMITS)
    answers = watch(guard, speed, 0.8, pose(yaw=yaw))
    assert answers[10] is None
    last = answers[-1]
    assert last is not None
    assert last[0] == pytest.approx(-LIMITS.backward, abs=0.05)
    first = next(number for number, one in enumerate(answers) if one is not None)
    left = 6.0 - speed * INTERVAL * first
    assert left - room_to_stop(speed, LIMITS, 0.0) > LIMITS.contact


def test_a_drone_that_still_flies_towards_them_gives_way_sooner() -> None:
    """What counts is how fast both close."""
    ahead = watch(ContactGuard(LIMITS), 1.3, 1.0, pose(forward=1.3))
    still = watch(ContactGuard(LIMITS), 1.3, 1.0, pose())
    assert sum(one is None for one in ahead) < sum(one is None for one in still)


def test_where_backing_off_is_too_late_it_steps_aside() -> None:
    """Out of the way of who comes, to the side that they do not go to."""
    for left in (0.3, -0.3):
        guard, drone = ContactGuard(LIMITS), pose(forward=1.5)
        answer = None
        for step in range(8):
            stamp = round(step * INTERVAL * NANOSECONDS)
            at = np.array([2.2 - 0.18 * step, left * step * INTERVAL])
            found = RelativeTarget(math.atan2(at[1], at[0]), float(np.hypot(*at)))
            guard.see([found], drone, stamp, INTERVAL)
            answer = guard.evade(drone, stamp)
        assert answer is not None
        assert answer[1] * left < -0.1


def test_above_the_head_it_climbs() -> None:
    """Which is nearer than a step aside."""
    answers = watch(ContactGuard(LIMITS), 1.8, 0.6, pose(height=2.0, forward=1.5))
    assert answers[-1] is not None
    assert answers[-1][2] > 1.0
    assert abs(answers[-1][1]) < 0.1


@pytest.mark.parametrize(("speed", "aside"), [(0.0, 0.0), (1.3, 1.5), (-1.0, 0.0)])
def test_who_stands_passes_or_goes_away_is_not_given_way_to(speed: float, aside: float) -> None:
    """They are the approach's business."""
    guard, drone = ContactGuard(LIMITS), pose()
    for step in range(40):
        distance = max(2.0 - speed * step * INTERVAL if speed <= 0 else 5.0 - speed * step / 10, -1)
        found = RelativeTarget(math.atan2(aside, distance), math.hypot(aside, distance))
        stamp = round(step * INTERVAL * NANOSECONDS)
        guard.see([found], drone, stamp, INTERVAL)
        assert guard.evade(drone, stamp) is None


def test_who_comes_and_is_out_of_sight_is_still_given_way_to() -> None:
    """Too near to be seen is no reason to stop; a second later it is over."""
    guard, drone = ContactGuard(LIMITS), pose()
    answers = watch(guard, 1.3, 0.9, drone)
    stamp = round(len(answers) * INTERVAL * NANOSECONDS)
    for later, gives_way in ((0.3, True), (3.0, False)):
        at = stamp + round(later * NANOSECONDS)
        guard.see([], drone, at, INTERVAL)
        assert (guard.evade(drone, at) is not None) is gives_way


def test_the_direction_is_kept_while_the_drone_turns() -> None:
    """Back is where they came from, whichever way the camera looks meanwhile."""
    guard = ContactGuard(LIMITS)
    answers = watch(guard, 1.3, 0.9, pose())
    turned = pose(yaw=math.pi / 2)
    answer = guard.evade(turned, round(len(answers) * INTERVAL * NANOSECONDS))
    assert answer is not None
    assert answer[1] > 1.5
    assert abs(answer[0]) < 1.6
