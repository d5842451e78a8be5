"""The page of the ROS 2 drivers says what their settings are."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from aerodaas.config.model import CameraConfig, EnvironmentConfig, validated
from aerodaas.extensions.ros2.driver.camera import Ros2Camera
from aerodaas.extensions.ros2.driver.settings import Ros2CameraSettings, Ros2Settings
from aerodaas.extensions.ros2.driver.vehicle import Ros2Vehicle

PAGE = (Path(__file__).parents[4] / "docs" / "ros2.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("model", "heading"), [(Ros2Settings, "Of the robot:"), (Ros2CameraSettings, "Of a camera")]
)
def test_every_setting_stands_there_with_its_default(model: type[BaseModel], heading: str) -> None:
    """Those of all cameras have a page of their own."""
    table = PAGE.partition(heading)[2].partition("\n\nOf")[0].partition("\n## ")[0]
    told = dict(re.findall(r"^\| `(\w+)` \| `?(.*?)`? \|", table, re.MULTILINE))
    common = CameraConfig.model_fields.keys() - {"topic"}
    expected = {
        name: "required" if field.is_required() else json.dumps(field.default)
        for name, field in model.model_fields.items()
        if model is Ros2Settings or name not in common
    }
    assert told == expected


def test_the_example_is_valid() -> None:
    """Drone and camera."""
    (example,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    environment: EnvironmentConfig = validated(json.loads(example), "the page")
    (robot,) = environment.robots
    Ros2Vehicle(robot, environment)
    assert environment.camera_driver(robot.sensors[0]) == "ros2"
    Ros2Camera(robot.sensors[0], environment)
