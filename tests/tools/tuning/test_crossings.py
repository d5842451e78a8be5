"""Whom a follower follows after another person in a vest of the same colour has crossed."""

from __future__ import annotations

import math

import pytest

from aerodaas.analytics.follow.followers import VipFollowAnalytics
from tools.tuning.chase import TELLO, Chase
from tools.tuning.meetings import STRANGER, crossing
from tools.tuning.perception import TruthPerception
from tools.tuning.walk import PERSON

WATCHED = 12.0


def cross(
    speed: float, seed: int, *, alike: bool = False, looks: bool = True, rate: float = 10.0
) -> tuple[float, float, list[str]]:
    """Metres from the drone to the followed person and to the other one, and the alerts."""
    world, crossed = crossing(speed, seed, alike=alike)
    person, stranger = world.thing(PERSON), world.thing(STRANGER)
    eyes = TruthPerception(
        person, "vest", TELLO, bystanders=[(stranger, "vest")], seed=seed, looks=looks
    )
    chase = Chase(person, "vest", rate, 0.25, seed=seed)
    flown = chase.fly(VipFollowAnalytics(), eyes, crossed + WATCHED)
    other = stranger.state(float(flown.time[-1]))
    east, north = flown.place[-1].tolist()
    away = math.hypot(other.x - east, other.y - north)
    return float(flown.distance[-1]), away, flown.alerts


@pytest.mark.parametrize("seed", [0, 2, 9])
@pytest.mark.parametrize("speed", [0.7, 1.3])
def test_the_drone_stays_with_the_person_whom_it_followed(speed: float, seed: int) -> None:
    """The clothes under the vests differ."""
    mine, other, _ = cross(speed, seed)
    assert mine < 4.5 < other


@pytest.mark.parametrize(("speed", "seed", "rate"), [(0.7, 2, 10.0), (0.7, 17, 5.0), (1.3, 2, 5.0)])
def test_where_both_look_alike_the_drone_follows_nobody_and_says_so(
    speed: float, seed: int, rate: float
) -> None:
    """It holds rather than guess."""
    mine, other, alerts = cross(speed, seed, alike=True, rate=rate)
    assert min(mine, other) > 4.5
    assert "target_uncertain" in alerts


def test_somebody_without_a_vest_is_nobody_to_be_mistaken_for() -> None:
    """Everybody's body is detected as well, and the own body's box always touches the vest."""
    world, crossed = crossing(0.7, 0, alike=True)
    person, stranger = world.thing(PERSON), world.thing(STRANGER)
    bodies = [(person, "person"), (stranger, "person")]
    eyes = TruthPerception(person, "vest", TELLO, bystanders=bodies, seed=0)
    flown = Chase(person, "vest", 10.0, 0.25).fly(VipFollowAnalytics(), eyes, crossed + WATCHED)
    assert flown.distance[-1] < 4.5
    assert "target_uncertain" not in flown.alerts


def test_a_better_target_that_one_frame_misses_is_awaited() -> None:
    """The nearer one is followed, though the frame of the choice showed the other one alone."""
    mine, other, _ = cross(0.7, 5)
    assert mine < 4.5 < other


def test_where_nobody_can_be_told_by_looks_it_is_said() -> None:
    """Boxes of a detector without appearances are followed as ever, and not without a word."""
    mine, other, alerts = cross(1.3, 0, looks=False)
    assert min(mine, other) < 4.5
    assert "target_uncertain" in alerts
