"""A survey planned for a robot of an environment, as an application asks for it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from flying import FLAT, robot
from keywords import keywords

from aerodaas import AeroNavigation, Environment
from aerodaas.errors import SchedulerError
from aerodaas.extensions.surveys.planning import plan_survey
from aerodaas.geometry.frames import GeodeticOrigin


def test_a_robot_plans_a_survey_by_its_camera(tmp_path: Path) -> None:
    """Flown from the height of the resolution; its plan has the triggers for a ground station."""
    lens = {"gimbal": {}, "horizontal_fov": 90, "width": 1000, "height": 500}
    drone = robot(sensors=[{"id": "cam", "settings": lens}])
    path = tmp_path / "environment.json"
    path.write_text(json.dumps({**FLAT, "robots": [drone]}))
    env = Environment(path)
    field = [(0.0, 0.0), (60.0, 0.0), (60.0, 40.0), (0.0, 40.0)]
    survey = plan_survey(
        env.get_robot_by_id("drone"),
        field,
        ground_resolution=0.02,
        camera="cam",
        front_overlap=0.8,
        side_overlap=0.5,
        speed=2.0,
    )
    assert survey.photos is not None
    assert [one.z for one in survey.waypoints] == pytest.approx([10.0] * 6)
    assert {one.speed for one in survey.waypoints} == {2.0}
    assert survey.photos.spacing == pytest.approx(2.0)
    assert survey.sweeps == 3
    assert len(survey.photos.places) == 3 * 31
    plan = tmp_path / "field.plan"
    AeroNavigation(data=survey.waypoints).to_plan(plan, GeodeticOrigin(47.0, 8.0, 500.0))
    with pytest.warns(UserWarning, match="NAV_TAKEOFF"):
        came = AeroNavigation.from_plan(plan).waypoints
    assert [keywords(one).trigger_distance for one in came] == [
        keywords(one).trigger_distance for one in survey.waypoints
    ]
    with pytest.raises(SchedulerError, match="a height or a ground resolution"):
        plan_survey(env.get_robot_by_id("drone"), field)
