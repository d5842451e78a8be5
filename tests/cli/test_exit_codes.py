"""The exit codes of docs/getting-started.md, each by the ways that lead to it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import exit_code
from flying import FLAT, robot

FAILED, WRONG = 1, 2
HOP = """
from aerodaas import *
env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
"""
FENCE = {"geofence": {"polygon": [[-10, -10], [10, -10], [10, 10], [-10, 10]]}}


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("AERODAAS_TOKEN", "any")
    Path("environment.json").write_text(json.dumps({**FLAT, "robots": [robot(limits=FENCE)]}))
    Path("broken.mcap").write_text("no recording")


@pytest.mark.parametrize(
    "words",
    [
        ["report", "none.mcap"],
        ["report", "broken.mcap"],
        ["view", "none.mcap"],
        ["report", "none.mcap", "broken.mcap"],
        ["export", "topics", "none.mcap"],
        ["import", "none"],
        ["compile", "none.mcap"],
        ["replay", "none.mcap", "--app", "farm_survey"],
        ["lab", "run", "--from", "none.mcap"],
        ["lab", "run", "--workload", "none.json"],
        ["plan", "show", "none.plan"],
        ["models", "check", "none.onnx"],
        ["serve", "none.json", "--state", "fleet"],
        ["run", "none.py"],
        ["check", "none.json"],
    ],
    ids=" ".join,
)
def test_a_missing_or_broken_file_is_wrong_input(words: list[str]) -> None:
    """Whatever kind of file, and whichever command reads it."""
    assert exit_code(*words) == WRONG


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("x = (\n", WRONG),
        ("import nonsense_module\n", WRONG),
        ("from aerodaas import Environmet\n", WRONG),
        ("open('none.csv')\n", WRONG),
        ("Environment\n", FAILED),
        ("1 / 0\n", FAILED),
        ("import sys\nsys.exit(7)\n", 7),
    ],
    ids=["syntax", "module", "name", "file", "NameError", "exception", "its own"],
)
@pytest.mark.parametrize("command", ["run", "compile --graph"])
def test_an_application_that_cannot_work_is_wrong_input(command: str, text: str, code: int) -> None:
    """What it raises while it works is a failure; its own code is its own."""
    Path("app.py").write_text(text)
    assert exit_code(*command.split(), "app.py") == code


@pytest.mark.parametrize(
    "waypoint",
    [
        'Waypoint("far", 99, 0, 2)',
        'Waypoint("far", 0, 0, 500)',
        'Waypoint("late", 1, 0, 2, deadline=-1.0)',
    ],
)
@pytest.mark.parametrize("command", ["run", "check"])
def test_a_plan_that_cannot_be_flown_is_wrong_input(command: str, waypoint: str) -> None:
    """It is refused before anything starts."""
    Path("app.py").write_text(
        f"{HOP}drone.navigate(AeroListData([{waypoint}]))\ndrone.start_mission()\n"
    )
    assert exit_code(command, "app.py") == WRONG
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    "words",
    [
        ["fleet", "--at", "http://127.0.0.1:9"],
        ["missions", "list", "--at", "http://127.0.0.1:9"],
        ["remote", "--url", "http://127.0.0.1:9", "status"],
    ],
    ids=" ".join,
)
def test_what_does_not_answer_has_failed(words: list[str]) -> None:
    """The words were right."""
    assert exit_code(*words) == FAILED
