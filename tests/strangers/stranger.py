"""A stranger's folder: files written there, flown by the real command line, and what came of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerodaas.recording.reader import Recording

COMMAND = Path(sys.executable).parent / "aerodaas"
CAMERA = {"id": "camera", "type": "camera", "rate": 5, "settings": {"width": 64, "height": 48}}
ENVIRONMENT: dict[str, Any] = {
    "robots": [{"id": "drone", "limits": {"cruise_speed": 3.0}, "sensors": [CAMERA]}],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty"},
}
HEAD = """
from aerodaas import AeroListData, Analytics, Environment, Frame, Waypoint

env = Environment("environment.json")
edge = env.get_compute_resource_by_id("edge")
drone = env.get_robot_by_id("drone")
camera = drone.get_sensor_by_id("camera").get_data_stream()
"""
FLY = """
drone.navigate(AeroListData([Waypoint("a", 2, 0, 2), Waypoint("b", 2, 2, 2)]))
drone.start_mission()
"""


@dataclass
class Flown:
    """What a flight left behind."""

    code: int
    said: str
    """Standard output and standard error, and the report."""
    recording: Path

    def values(self, stream: str) -> list[tuple[str, Any]]:
        """Class and content of what was recorded of a stream."""
        with Recording.open(self.recording) as opened:
            records = opened.records(topics={f"/{stream}/value"})
            return [(one.value.type, one.value.value) for one in records]

    def lines(self, stream: str) -> set[str]:
        """Texts that were recorded of a stream."""
        with Recording.open(self.recording) as opened:
            records = opened.records(topics={"/log"})
            return {one.value.message for one in records if one.value.name == stream}

    def alerts(self) -> list[str]:
        """What people were told."""
        with Recording.open(self.recording) as opened:
            return [one.value.text for one in opened.records(topics={"/alerts"})]

    def landed_as_planned(self) -> bool:
        """Whether all waypoints were visited."""
        return "landed: all waypoints are visited; 2 of 2 waypoints" in self.said


def write(folder: Path, files: dict[str, str], environment: dict[str, Any] | None = None) -> None:
    """Write an environment file, and `files` by their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "environment.json").write_text(json.dumps(environment or ENVIRONMENT))
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))


def fly(folder: Path, *words: str, python: bool = False) -> Flown:
    """`aerodaas run WORDS` in `folder`, or `python WORDS`; without any of this project's paths."""
    command = [sys.executable, *words] if python else [str(COMMAND), "run", *words]
    before = set(folder.rglob("*.mcap"))
    done = run(folder, *command)
    made = set(folder.rglob("*.mcap")) - before
    assert len(made) == 1, f"{done.stdout}{done.stderr}"
    (recording,) = made
    summary = recording.parent / "summary.txt"
    told = summary.read_text() if summary.exists() else ""
    return Flown(done.returncode, f"{done.stdout}{done.stderr}{told}", recording)


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a command as a user would who has never seen the project's folder."""
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        command, cwd=folder, env=variables, capture_output=True, text=True, timeout=300, check=False
    )
