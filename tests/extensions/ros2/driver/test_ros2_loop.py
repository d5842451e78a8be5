"""The velocity loop alone: places that are stopped at and passed."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.extensions.ros2.driver.loop import Limits, VelocityLoop
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint


@pytest.mark.parametrize(("asked", "passed"), [(0.0, 0.0), (0.8, 0.8), (9.0, 1.5)])
def test_a_place_is_passed_no_faster_than_the_way_there(asked: float, passed: float) -> None:
    """At the place itself, whose setpoint is told as it was clipped."""
    loop = VelocityLoop(Limits(2.0, 3.0, 1.0, 0.5, 1.0), 0.0)
    place = PositionSetpoint(np.array([10.0, 0.0, 2.0]), None, 1.5, asked)
    near = Odometry(np.array([9.999, 0.0, 2.0]), np.zeros(3), 0.0)
    clipped, wanted = loop.guide(place, near, 0.0)
    assert isinstance(clipped, PositionSetpoint)
    assert (clipped.speed, clipped.passing_speed) == (1.5, passed)
    assert wanted.velocity[0] == pytest.approx(passed, abs=0.02)
