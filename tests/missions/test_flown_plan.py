"""A ground station's plan, flown."""

from __future__ import annotations

import json
from typing import Any

import pytest
from flying import FLAT, Flyer, recorded

from aerodaas import AeroNavigation, Environment

pytestmark = pytest.mark.wall_clock


def test_a_survey_of_qgroundcontrol_is_flown(flyer: Flyer) -> None:
    """To each of its places, in its order, around the environment's home."""
    path = flyer.folder / "survey.plan"
    corners = [(47.0001, 8.0), (47.0001, 8.0002), (47.0, 8.0002)]
    items: list[dict[str, Any]] = [
        {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, *at, 4]}
        for at in corners
    ]
    triggers = {"type": "SimpleItem", "command": 206, "frame": 2, "params": [5, 0, 1, 0, 0, 0, 0]}
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": [items[0], triggers, *items[1:]]},
    }
    path.write_text(json.dumps({"fileType": "Plan", "mission": {"items": [survey]}}))

    def build(environment: Environment) -> None:
        with pytest.warns(UserWarning, match="item 2: DO_SET_CAM_TRIGG_DIST: no picture"):
            navigation = AeroNavigation.from_plan(path)
        environment.get_robot_by_id("drone").navigate(navigation)

    run = flyer.fly(
        build, {**FLAT, "home": {"latitude": 47.0, "longitude": 8.0, "altitude": 535.0}}
    )
    drone = recorded(run).robots["drone"]
    assert drone.visited == ("item1", "item3", "item4")
    assert drone.outcome.startswith("landed")
