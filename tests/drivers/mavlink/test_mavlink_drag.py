"""Guidance of an autopilot that has learned to lean against the air, and unlearns it late."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aerodaas.drivers.mavlink.control.guidance import MovingTarget, Target
from aerodaas.types.vehicle import PositionSetpoint

_DRAG = 1.0
"""1/s, that of PX4's simulated quadrotor (SIH_KDV and SIH_MASS)."""
_STRONGEST = 9.8
"""m/s²: PX4 leans by 45 degrees at most."""
_STEP = 0.01


def flown(
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
    track = flown([(0, 0), (150, 0)], speed, 0.05, lines=False)
    assert track[int(np.argmax(track[:, 0] > 148.0)), 2] < slow
    assert track[:, 0].max() < 150.1


@pytest.mark.parametrize(("speed", "beyond"), [(3.0, 0.78), (5.0, 1.17), (7.0, 1.46)])
def test_what_flies_aside_from_its_line_is_told_to_fly_back(speed: float, beyond: float) -> None:
    """Without that it would overshoot a right angle by 0.85, 1.28 and 1.60 m."""
    track = flown([(0, 0), (150, 0), (150, 60)], speed, 2.0, lines=True)
    assert 0.0 < track[:, 0].max() - 150.0 < beyond
    assert abs(track[-1, 0] - 150.0) < 0.4


@pytest.mark.parametrize(("aside", "back"), [(0.3, 0.0), (-0.3, 0.0), (1.3, -0.5), (-1.3, 0.5)])
def test_a_little_aside_is_no_excess(aside: float, back: float) -> None:
    """What wind and an estimate do to a vehicle on its line is the autopilot's own affair."""
    setpoint = PositionSetpoint(np.array([100.0, 0.0, 0.0]), None, 5.0, 0.0, np.zeros(3))
    seen = MovingTarget(3.0, 1.5).towards(
        setpoint,
        5.0,
        vehicle=np.array([10.0, 0.0, 0.0]),
        velocity=np.array([5.0, aside, 0.0]),
        facing=0.0,
        now=100.0,
    )
    assert seen.velocity[1] == pytest.approx(back)
