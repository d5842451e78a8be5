"""A ground station's plan, flown."""

from __future__ import annotations

import json
from typing import Any

import pytest
from flying import FLAT, Flyer, recorded, robot

from aerodaas import AeroNavigation, Environment
from aerodaas.recording.reader import Recording

pytestmark = pytest.mark.wall_clock


def test_a_survey_of_qgroundcontrol_is_flown(flyer: Flyer) -> None:
    """To each of its places, in its order, around the environment's home, with its pictures."""
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
        navigation = AeroNavigation.from_plan(path)
        environment.get_robot_by_id("drone").navigate(navigation)

    camera = {"id": "camera", "rate": 1, "settings": {"width": 64, "height": 36}}
    home = {"latitude": 47.0, "longitude": 8.0, "altitude": 535.0}
    run = flyer.fly(build, {**FLAT, "home": home, "robots": [robot(sensors=[camera])]})
    drone = recorded(run).robots["drone"]
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        pictures = list(recording.records(topics=["/drone/photos"]))
    # Every 5 m of 15 m to the east and 11 m to the south.
    assert len(pictures) == 6
    assert drone.visited == ("item1", "item3", "item4")
    assert drone.outcome.startswith("landed")
