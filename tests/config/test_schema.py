"""The schema of environment files, by which editors explain each setting."""

from __future__ import annotations

import json

import pytest

from aerodaas.config.schema import environment_schema


@pytest.mark.parametrize(
    ("part", "setting", "text"),
    [
        ("HomeConfig", "altitude", "Above the ellipsoid, as GPS counts."),
        ("LimitsConfig", "max_yaw_rate", "Degrees per second."),
        ("PreflightConfig", "cells", "Voltage of each cell of the battery."),
        ("TerrainConfig", "clearance", "from the end of the take-off"),
        ("ComputeConfig", "executors", "Inferences that may run at once."),
        ("RecordingConfig", "images", "so that a\nreplay sees what was seen"),
    ],
)
def test_settings_are_explained(part: str, setting: str, text: str) -> None:
    """By their docstrings, wherever their class stands."""
    shown = json.loads(environment_schema())["$defs"][part]["properties"][setting]
    assert text in shown["description"]


def test_each_part_has_its_settings_alone() -> None:
    """What inherits from another one, or is called alike, mixes nothing up."""
    parts = json.loads(environment_schema())["$defs"]
    assert "description" not in parts["LimitsConfig"]["properties"]["cruise_speed"]
    assert "None: a camera" in parts["SensorConfig"]["properties"]["driver"]["description"]
    assert "description" not in parts["RobotConfig"]["properties"]["driver"]
