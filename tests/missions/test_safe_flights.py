"""What the drone's actor refuses or prevents, in whole applications."""

from __future__ import annotations

from typing import Any

import pytest
from flying import FLAT, Flyer, robot

from aerodaas import AeroNavigation, Environment, VelocityCommand
from aerodaas.errors import MissionError


@pytest.mark.parametrize(
    ("changes", "reasons"),
    [
        (
            {"start": [50.0, 0.0, 0.0], "driver": "simulated"},
            ["outside its geofence"],
        ),
        (
            {"start": [50.0, 0.0, 0.0], "settings": {"battery": 0.1}},
            ["outside its geofence", "the battery is at"],
        ),
    ],
)
def test_take_off_is_refused_with_all_reasons(
    flyer: Flyer, changes: dict[str, Any], reasons: list[str]
) -> None:
    """The mission ends on the ground, and the error lists what was wrong."""
    fence = {"polygon": [[-10, -10], [10, -10], [10, 10], [-10, 10]]}
    drone = robot(limits={"geofence": fence}, **changes)

    def build(env: Environment) -> None:
        # Not by waypoints: those outside the fence are refused before there is a take-off.
        env.get_robot_by_id("drone").navigate(AeroNavigation(data=[VelocityCommand(forward=1.0)]))

    with pytest.raises(MissionError, match="take-off refused") as refused:
        flyer.fly(build, {**FLAT, "robots": [drone]})
    for reason in reasons:
        assert reason in str(refused.value)
