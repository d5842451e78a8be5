"""Mission documents, from their bytes to the graph of a small environment."""

from __future__ import annotations

import json
import random
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from aerodaas.analytics.here.analysis import HereSite
from aerodaas.config.options import RunOptions, current_options
from aerodaas.dataflow.mission_document import MissionDocument, read_mission
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.environment import Environment
from aerodaas.errors import AeroDaaSError
from tools.fuzz.json_changes import VALUES, change_value, flip_byte

__all__ = ["mutate", "run", "seeds"]

_FOLDER = Path(tempfile.mkdtemp(prefix="aerodaas-fuzz-"))
_FILE = _FOLDER / "mission.json"
_ENVIRONMENT = _FOLDER / "environment.json"
_BYTES = 0.1
"""Share of mutations that change a byte."""
_ENVIRONMENT.write_text(
    json.dumps(
        {
            "robots": [
                {
                    "id": "drone",
                    "sensors": [
                        {"id": "odom", "type": "odometry"},
                        {"id": "cam", "type": "camera"},
                        {"id": "gps", "type": "gps"},
                    ],
                },
                {"id": "other", "sensors": [{"id": "odom", "type": "odometry"}]},
            ],
            "compute": [{"id": "edge", "kind": "edge"}],
        }
    )
)
_HEAD: dict[str, Any] = {"format": "aerodaas-mission", "version": 1}
_FOLLOW = {
    "id": "drone/follow",
    "analysis": "FollowAnalytics",
    "settings": {
        "gains": {"$settings": "FollowGains", "of": {}},
        "lost": {"$settings": "LostPolicy", "of": {}},
    },
    "reads": ["drone/tracking"],
    "compute": "edge",
    "task": {"benefit": 2.0},
}
_SPECIAL = (
    {"$here": 0},
    {"$here": "os.system"},
    {"$environment": "handle"},
    {"$environment": "data"},
    {"$condition": "fallen"},
    {"$analysis": "MonitoringAnalytics", "settings": {}},
    {"$output": "../x"},
    {"$property": ["drone/cam", "width"]},
    {"$model": "a.onnx", "sha256": "0" * 64},
    {"produces": "AeroNavigation"},
    "drone",
    "drone/odom",
    "drone/monitoring",
)


def seeds() -> Iterable[bytes]:
    """Documents with each kind of entry."""
    waypoint = {"id": "a", "x": 1.0, "y": 2.0, "z": 3.0}
    monitoring = {
        "id": "drone/monitoring",
        "analysis": "MonitoringAnalytics",
        "settings": {"readings": ["position", "height"]},
        "reads": ["drone/odom"],
        "compute": "edge",
        "triggers": [
            {
                "target": "drone",
                "command": "end_mission",
                "when": {"$settings": "Near", "of": {"place": [1.0, 2.0], "metres": 3.0}},
            },
            {"target": "drone", "command": "pause_mission", "when": {"$here": 1}},
        ],
    }
    detection = {"id": "drone/people", "analysis": "OnnxDetector", "reads": ["drone/cam"]}
    tracking = {"id": "drone/tracking", "analysis": "TrackingAnalytics", "reads": ["drone/people"]}
    pose = {
        "id": "drone/pose",
        "analysis": "BodyPoseEmergencyAnalytics",
        "settings": {"detector": {"$analysis": "PoseAnalytics", "settings": {}}},
        "reads": ["drone/cam"],
        "triggers": [
            {"target": "drone", "command": "end_mission", "when": {"$condition": "fallen"}}
        ],
    }
    here = [
        {
            "id": "drone/legs",
            "here": {"produces": "object"},
            "reads": ["drone/odom"],
            "triggers": [{"target": "drone/circle", "when": {"$here": 0}}],
        },
        {"id": "drone/circle", "here": {"produces": "AeroNavigation"}, "reads": ["drone/legs"]},
        {"id": "wind", "here": {"produces": "float"}, "rate": 2.0},
    ]
    sensors = ["drone/odom", "drone/cam"]
    by_waypoints = {"robot": "drone", "waypoints": [waypoint], "ordered": False, "deadline": 9.0}
    yield _written(navigation=[by_waypoints], trajectory_scheduler={"name": "ordered"})
    yield _written(
        sensors=sensors,
        analyses=[monitoring, detection, tracking, _FOLLOW, pose],
        navigation=[by_waypoints, {"robot": "drone", "stream": "drone/follow", "priority": 1}],
        analytics_scheduler="dems",
    )
    yield _written(
        sensors=sensors,
        analyses=[monitoring, *here],
        navigation=[{"robot": "drone", "stream": "drone/circle", "clear_on": "drone/circle"}],
        trajectory_scheduler={"name": "optimal", "settings": {"objective": "time"}},
    )


def run(data: bytes) -> None:
    """Read the document, and build what it says."""
    _FILE.write_bytes(data)
    current_options.set(RunOptions(view=False))
    try:
        document = read_mission(_FILE)
        again = MissionDocument.model_validate_json(document.text())
        if again != document:
            raise AssertionError("a document is another one once written")
        environment = Environment(_ENVIRONMENT)
        build_mission(document, environment, _FOLDER, HereSite(_FOLDER / "here.sock"))
    except AeroDaaSError as error:
        str(error).encode()


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Change a few values of the JSON, and one byte now and then."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return flip_byte(data, rng)
    if rng.random() < _BYTES:
        return flip_byte(data, rng)
    for _ in range(rng.randrange(1, 4)):
        change_value(content, rng, (*VALUES, *_SPECIAL))
        try:
            data = json.dumps(content).encode()
        except (ValueError, RecursionError):  # it holds itself
            break
        content = json.loads(data)
    return data


def _written(**parts: object) -> bytes:
    return json.dumps({**_HEAD, **parts}).encode()
