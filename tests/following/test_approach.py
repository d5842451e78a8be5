"""The limit of approach: whoever keeps it stops before the least distance, whatever they follow."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.steering import ApproachLimit, closing_speed
from aerodaas.following.target import RelativeTarget
from aerodaas.messages.odometry import Odometry

LIMITS = FollowLimits()
GAPS = st.floats(-3.0, 30.0)
INTERVAL = 0.2
"""Seconds between two pictures."""
AT_ORIGIN = Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), 0.0)


def limit() -> ApproachLimit:
    """One that keeps 1.2 m."""
    return ApproachLimit(1.2, LIMITS)


@given(gap=GAPS, deceleration=st.floats(0.5, 5.0), reaction=st.floats(0.1, 1.0))
def test_a_drone_at_the_limit_stops_within_the_gap(
    gap: float, deceleration: float, reaction: float
) -> None:
    """It flies on for the reaction time and then brakes; without room it backs away."""
    speed = closing_speed(gap, deceleration, reaction)
    if gap < 0:
        assert speed < 0
    else:
        assert speed * reaction + speed**2 / (2 * deceleration) <= gap + 1e-9


@given(nearer=GAPS, farther=GAPS)
def test_more_room_allows_no_less_speed(nearer: float, farther: float) -> None:
    """Also across the border, where it is zero."""
    nearer, farther = sorted((nearer, farther))
    assert closing_speed(nearer, 2.5, 0.5) <= closing_speed(farther, 2.5, 0.5)
    assert closing_speed(0.0, 2.5, 0.5) == 0.0


@given(distance=st.floats(0.0, 20.0), away=st.floats(0.0, 3.0))
def test_nothing_is_gained_by_a_target_that_walks_away(distance: float, away: float) -> None:
    """It may stop this moment."""
    target = RelativeTarget(0.0, distance)
    assert limit().speed(target, away, AT_ORIGIN) == limit().speed(target, 0.0, AT_ORIGIN)


def test_a_target_that_comes_nearer_is_given_way() -> None:
    """By its own speed."""
    target = RelativeTarget(0.0, 1.2)
    assert limit().speed(target, -0.6, AT_ORIGIN) == pytest.approx(-0.6)


@given(distance=st.floats(0.0, 20.0), blind=st.floats(0.01, 1.0))
def test_who_sees_seldom_comes_near_slower(distance: float, blind: float) -> None:
    """And backs off as soon as others do."""
    approach, late = limit(), limit()
    late.see(None, [], AT_ORIGIN, blind)
    one, other = (a.speed(RelativeTarget(0.0, distance), 0.0, AT_ORIGIN) for a in (approach, late))
    assert abs(other) < abs(one) or one == other == 0.0
    assert one * other >= 0.0


@pytest.mark.parametrize("odometry", [AT_ORIGIN, None])
@pytest.mark.parametrize(("bearing", "limits"), [(0.3, True), (-0.3, True), (1.4, False)])
def test_somebody_else_in_the_way_counts(
    odometry: Odometry | None, bearing: float, *, limits: bool
) -> None:
    """Who stands aside does not."""
    approach = limit()
    free = approach.speed(RelativeTarget(0.0, 4.0), 0.0, odometry)
    approach.see(None, [RelativeTarget(bearing, 1.3)], odometry, INTERVAL)
    assert (approach.speed(RelativeTarget(0.0, 4.0), 0.0, odometry) < 0.3 < free) is limits


def test_they_stay_where_they_were_while_the_drone_flies_and_sees_nothing() -> None:
    """A drone that has come a metre nearer has a metre less to go."""
    approach = limit()
    approach.see(RelativeTarget(0.0, 2.4), [], AT_ORIGIN, INTERVAL)
    approach.see(None, [], AT_ORIGIN, INTERVAL)
    moved = Odometry(np.array([1.0, 0.0, 1.5]), np.zeros(3), 0.0)
    found = approach.speed(RelativeTarget(0.0, 5.0), 1.0, moved)
    reaction_time = LIMITS.reaction_time + INTERVAL
    assert found == pytest.approx(closing_speed(0.2, LIMITS.braking, reaction_time))
    assert math.isfinite(found)


def test_others_stop_the_drone_but_do_not_drive_it_back() -> None:
    """Whoever is taken for a person by mistake must not push it into what it does not see."""
    approach = limit()
    approach.see(RelativeTarget(0.0, 4.0), [RelativeTarget(0.2, 0.5)], AT_ORIGIN, INTERVAL)
    assert approach.speed(RelativeTarget(0.0, 4.0), 0.0, AT_ORIGIN) == 0.0
    approach.see(RelativeTarget(0.0, 0.5), [], AT_ORIGIN, INTERVAL)
    assert approach.speed(RelativeTarget(0.0, 0.5), 0.0, AT_ORIGIN) < -1.0


@given(speed=st.floats(0.0, 1.5), away=st.floats(0.0, 1.5), distance=st.floats(1.5, 6.0))
def test_a_drone_that_gains_on_its_target_must_slow_down_sooner(
    speed: float, away: float, distance: float
) -> None:
    """By what it gains until the airframe answers; one that does not gain loses nothing."""
    target = RelativeTarget(0.0, distance)
    flying = Odometry(np.array([0.0, 0.0, 1.5]), np.array([speed, 0.0, 0.0]), 0.0)
    gained = LIMITS.response * max(0.0, speed - away)
    found = limit().speed(target, away, flying)
    assert found == pytest.approx(
        limit().speed(RelativeTarget(0.0, distance - gained), 0.0, AT_ORIGIN)
    )
