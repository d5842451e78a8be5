"""An inspection with a depth camera stops before what stands between it and its tower."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.following.inspection import InspectionController, InspectionPlan
from aerodaas.following.target import Observation, RelativeTarget
from aerodaas.messages.odometry import Odometry

TOWER, WALL = 30.0, 12.0
"""Metres ahead of where it begins."""


def fly(aside: float, *, measures: bool) -> float:
    """How far ahead it has come after 60 s at 10 frames a second; the wall begins `aside` left."""
    plan = InspectionPlan(stand_off=8.0, base=2.0, top=20.0)
    control = InspectionController(plan)
    place, speed = 0.0, 0.0
    for step in range(600):
        state = Odometry(np.array([place, 0.0, 2.0]), np.array([speed, 0.0, 0.0]), 0.0)
        wall = [(WALL - place, left) for left in np.arange(aside, aside + 3.0, 0.2)]
        near = np.array([point for point in wall if 0.0 < point[0] < 10.0]).reshape(-1, 2)
        seen = Observation(
            step * NANOSECONDS // 10,
            RelativeTarget(0.0, TOWER - place),
            state,
            surfaces=near if measures else None,
        )
        command = control.step(seen)
        wanted = command.forward if command is not None else 0.0
        speed += (wanted - speed) * 0.1 / 0.4
        place += speed * 0.1
    return place


@pytest.mark.parametrize("aside", [-1.0, 0.3])
def test_it_waits_before_a_wall_in_its_way(aside: float) -> None:
    """Which it would fly into without depth."""
    assert fly(aside, measures=False) > WALL
    assert WALL - 1.0 < fly(aside, measures=True) < WALL - 0.5


def test_it_goes_by_a_wall_beside_its_way() -> None:
    """Up to the stand-off."""
    assert abs(fly(0.8, measures=True) - (TOWER - 8.0)) < 0.8
