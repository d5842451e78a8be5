"""The moving target: never faster than asked, slow where it arrives, onto the next line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.drivers.mavlink.control.guidance import MovingTarget, Target
from aerodaas.messages.vehicle import PositionSetpoint

_DRAG = 1.0
"""1/s, that of PX4's simulated quadrotor (SIH_KDV and SIH_MASS)."""
_STRONGEST = 9.8
"""m/s²: PX4 leans by 45 degrees at most."""
_STEP = 0.01
EXAMPLES = 12
"""Whole flights, a second each four."""
place = st.tuples(*[st.floats(-100.0, 100.0)] * 3).map(np.array)


@given(
    place,
    st.floats(0.2, 10),
    st.lists(st.floats(0.0, 0.5), min_size=5, max_size=60),
)
def test_the_moving_target_keeps_to_its_speed(goal: Any, speed: float, waits: list[float]) -> None:  # noqa: ANN401
    """It never moves faster than asked, never runs far ahead, and never overshoots."""
    target = MovingTarget(3.0, 1.5)
    here, now = np.zeros(3), 100.0
    before: Any = None
    for wait in waits:
        now += wait
        seen = target.towards(
            PositionSetpoint(goal),
            speed,
            vehicle=here,
            velocity=np.zeros(3),
            facing=0.0,
            now=now,
        )
        if before is not None:
            moved = float(np.linalg.norm(seen.position - before))
            assert moved <= speed * min(wait, 0.2) + 1e-6
        assert float(np.linalg.norm(seen.position)) <= 1.0 + 1.2 * speed + 1e-6
        assert np.linalg.norm(seen.position) <= np.linalg.norm(goal) + 1e-6
        before = seen.position


def flown_by_lag(goal: float, speed: float, lag: float) -> NDArray[np.float64]:
    """Place and speed of an autopilot on a straight way, one row each 10 ms.

    It adds what draws it to the target to the velocity that it was sent, as PX4 does, takes that
    up after `lag` seconds, and hears of the target a tenth of a second late.
    """
    target = MovingTarget(3.0, 1.5)
    here = moving = 0.0
    sent: list[tuple[float, float]] = []
    track = []
    for turn in range(round(20 * (goal / speed + 15))):
        seen = target.towards(
            PositionSetpoint(np.array([goal, 0.0, 0.0])),
            speed,
            vehicle=np.array([here, 0.0, 0.0]),
            velocity=np.array([moving, 0.0, 0.0]),
            facing=0.0,
            now=100.0 + turn / 20,
        )
        sent.append((float(seen.position[0]), float(seen.velocity[0])))
        place, velocity = sent[max(0, turn - 2)]
        for _ in range(5):
            wanted = velocity + 0.95 * (place - here)
            moving += 0.01 * max(-3.0, min(3.0, (wanted - moving) / lag))
            here += 0.01 * moving
            track.append((here, moving))
    return np.array(track)


@given(st.floats(2.0, 15.0), st.floats(0.5, 3.0), st.floats(0.1, 0.8))
@settings(max_examples=EXAMPLES)
def test_a_vehicle_that_follows_late_is_slow_where_it_arrives(
    goal: float, speed: float, lag: float
) -> None:
    """Never faster than asked, hardly beyond the place, and slow where a landing may follow."""
    track = flown_by_lag(goal, speed, lag)
    assert track[:, 1].max() < 1.05 * speed
    assert track[:, 0].max() < goal + 0.2
    assert track[-1] == pytest.approx([goal, 0.0], abs=0.05)
    near = int(np.argmax(track[:, 0] > goal - 0.3))
    assert track[near, 1] < 0.9


@given(st.floats(2.0, 15.0), st.floats(0.1, 0.8))
@settings(max_examples=EXAMPLES)
def test_a_long_way_is_flown_at_the_speed_asked_for(speed: float, lag: float) -> None:
    """Once fast, the vehicle stays so until it has to brake: its target does not wait for it."""
    ramp, goal = 3.0 * speed + 10.0, 40.0 * speed + 100.0
    track = flown_by_lag(goal, speed, lag)
    on_the_way = (track[:, 0] > ramp) & (track[:, 0] < 0.5 * goal)
    assert track[on_the_way, 1].min() > 0.9 * speed


def flown_along(
    corners: list[tuple[float, float]], speed: float, passing: float, radius: float, lag: float
) -> NDArray[np.float64]:
    """Places and speeds along a path, one row each 10 ms, of an autopilot as in `flown_by_lag`.

    Within `radius` of a corner the next one is its place; the first one is where it begins.
    """
    target, here, moving = MovingTarget(3.0, 1.5), np.array([*corners[0], 0.0]), np.zeros(3)
    places = [np.array([*corner, 0.0]) for corner in corners]
    leg, sent, track = 1, list[Any](), list[tuple[float, ...]]()
    for turn in range(4000):
        if np.linalg.norm(places[leg] - here) <= radius:
            leg += 1
            if leg == len(places):
                break
        last = leg == len(places) - 1
        setpoint = PositionSetpoint(
            places[leg], None, speed, 0.0 if last else passing, places[leg - 1]
        )
        seen = target.towards(
            setpoint, speed, vehicle=here, velocity=moving, facing=0.0, now=100.0 + turn / 20
        )
        sent.append(seen)
        late = sent[max(0, turn - 2)]
        for _ in range(5):
            wanted = late.velocity + 0.95 * (late.position - here)
            change = (wanted - moving) / lag
            moving = moving + 0.01 * change * min(
                1.0, 3.0 / max(1e-9, float(np.linalg.norm(change)))
            )
            here = here + 0.01 * moving
            track.append((*here[:2], float(np.linalg.norm(moving))))
    return np.array(track)


@given(st.floats(2.0, 12.0), st.floats(0.1, 0.8), st.floats(0.3, 3.0))
@settings(max_examples=EXAMPLES)
def test_a_corner_of_a_path_leads_onto_the_next_line(
    speed: float, lag: float, radius: float
) -> None:
    """A target that turned early comes onto the line, and the vehicle after it."""
    far = 15.0 * speed
    track = flown_along([(0, 0), (far, 0), (far, far)], speed, 0.0, radius, lag)
    after = track[track[:, 1] > far / 3]
    assert len(after) > 0
    assert np.abs(after[:, 0] - far).max() < 0.15
    assert track[:, 0].max() < far + 1.0
    assert track[-1] == pytest.approx([far, far, 0.0], abs=radius + 1.5)


@given(st.floats(2.0, 12.0), st.floats(0.1, 0.8), st.floats(0.2, 1.0))
@settings(max_examples=EXAMPLES)
def test_a_place_is_passed_at_the_speed_asked_for(speed: float, lag: float, share: float) -> None:
    """Neither a stop nor a burst, and at the end of the path it stops."""
    far, passing = 15.0 * speed, share * speed
    track = flown_along([(0, 0), (far, 0), (2 * far, 0)], speed, passing, 0.5, lag)
    there = track[int(np.argmax(track[:, 0] > far - 0.5)), 2]
    assert 0.75 * passing - 0.2 < there < passing + 1.2
    assert track[:, 2].max() < 1.1 * speed
    assert track[:, 0].max() < 2 * far + 0.3


def test_a_vehicle_at_its_limit_is_asked_for_little_more_than_it_does() -> None:
    """Against the wind it flies at 6 m/s, whatever it is told."""
    target, here, moving = MovingTarget(3.0, 1.5), np.zeros(3), np.array([6.0, 0.0, 0.0])
    far = PositionSetpoint(np.array([900.0, 0.0, 0.0]))
    seen = target.towards(far, 10.0, vehicle=here, velocity=moving, facing=0.0, now=100.0)
    for turn in range(1, 400):
        here = here + moving * 0.05
        seen = target.towards(
            far, 10.0, vehicle=here, velocity=moving, facing=0.0, now=100.0 + turn / 20
        )
    assert float(seen.velocity[0]) <= 8.0
    assert 0.5 < float(seen.position[0] - here[0]) < 2.5


def test_a_vehicle_that_was_blown_far_away_is_waited_for() -> None:
    """Its target stands and is not flown on from."""
    target, far = MovingTarget(3.0, 1.5), PositionSetpoint(np.array([900.0, 0.0, 0.0]))
    state: dict[str, Any] = {"velocity": np.zeros(3), "facing": 0.0}
    first = target.towards(far, 5.0, vehicle=np.zeros(3), now=100.0, **state)
    blown = first.position + np.array([0.0, 6.5, 0.0])
    seen = target.towards(far, 5.0, vehicle=blown, now=100.05, **state)
    assert seen.position.tolist() == first.position.tolist()
    assert not seen.velocity.any()


def flown_leaning(
    corners: list[tuple[float, float]], speed: float, radius: float, *, lines: bool
) -> NDArray[np.float64]:
    """Places and speeds along a path, one row each 10 ms, by PX4's control with its own gains.

    Within `radius` of a corner the next one is its place; `lines` has it keep to the legs.
    """
    target = MovingTarget(3.0, 1.5)
    places = [np.array([*corner, 0.0]) for corner in corners]
    here, moving = places[0], np.zeros(3)
    learned, leaning = np.zeros(3), np.zeros(3)
    leg, sent, track = 1, list[Target](), list[tuple[float, ...]]()
    for turn in range(2000):
        if np.linalg.norm(places[leg] - here) <= radius:
            leg += 1
            if leg == len(places):
                break
        start = places[leg - 1] if lines else None
        seen = target.towards(
            PositionSetpoint(places[leg], None, speed, 0.0, start),
            speed,
            vehicle=here,
            velocity=moving,
            facing=0.0,
            now=100.0 + turn / 20,
        )
        sent.append(seen)
        late = sent[max(0, turn - 2)]
        for _ in range(5):
            missing = late.velocity + 0.95 * (late.position - here) - moving
            wanted = 1.8 * missing + learned
            strength = float(np.linalg.norm(wanted))
            if strength > _STRONGEST:
                wanted = wanted * (_STRONGEST / strength)
            else:
                learned = learned + 0.4 * _STEP * missing
            leaning = leaning + _STEP * (wanted - leaning) / 0.15
            moving = moving + _STEP * (leaning - _DRAG * moving)
            here = here + _STEP * moving
            track.append((*here[:2], float(np.linalg.norm(moving))))
    assert leg == len(places)
    return np.array(track)


@pytest.mark.parametrize(("speed", "slow"), [(3.0, 1.85), (5.0, 2.25), (7.0, 2.6)])
def test_what_is_too_fast_before_a_place_is_told_to_be_slower_still(
    speed: float, slow: float
) -> None:
    """Without that it would come 2 m before the place at 1.95, 2.43 and 2.82 m/s."""
    track = flown_leaning([(0, 0), (150, 0)], speed, 0.05, lines=False)
    assert track[int(np.argmax(track[:, 0] > 148.0)), 2] < slow
    assert track[:, 0].max() < 150.1


@pytest.mark.parametrize(("speed", "beyond"), [(3.0, 0.78), (5.0, 1.17), (7.0, 1.46)])
def test_what_flies_aside_from_its_line_is_told_to_fly_back(speed: float, beyond: float) -> None:
    """Without that it would overshoot a right angle by 0.85, 1.28 and 1.60 m."""
    track = flown_leaning([(0, 0), (150, 0), (150, 60)], speed, 2.0, lines=True)
    assert 0.0 < track[:, 0].max() - 150.0 < beyond
    assert abs(track[-1, 0] - 150.0) < 0.4
