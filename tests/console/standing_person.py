"""A flight that hovers before a person who stands still, at a known place."""

from __future__ import annotations

import json
from pathlib import Path

__all__ = ["PERSON", "write_flight"]

PERSON = (1.5, 8.0)
"""Metres east and north."""
_APPLICATION = """
from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.analytics import OnnxDetector, TrackingAnalytics

env = Environment("environment.json")
edge = env.get_compute_resource_by_id("edge")
drone = env.get_robot_by_id("drone")
camera = drone.get_sensor_by_id("cam").get_data_stream()
people = OnnxDetector(classes=["person"]).deploy(edge).analyse(camera)
TrackingAnalytics().deploy(edge).analyse(people)
drone.navigate(AeroNavigation(data=[Waypoint("there", 0, 0, 3, hover_duration=40)]))
drone.start_mission()
"""
_ENVIRONMENT = {
    "name": "standing",
    "robots": [
        {
            "id": "drone",
            "driver": "simulated",
            "start_yaw": 90,
            "sensors": [
                {
                    "id": "cam",
                    "type": "camera",
                    "rate": 5,
                    "settings": {"width": 640, "height": 360, "pitch": 20},
                }
            ],
        }
    ],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "world.json"},
}
_WORLD = {
    "name": "standing",
    "entities": [{"kind": "person", "id": "standing", "at": PERSON}],
}


def write_flight(folder: Path) -> Path:
    """Write the application, its environment and its world; returns the application's file."""
    path = folder / "standing.py"
    path.write_text(_APPLICATION)
    (folder / "environment.json").write_text(json.dumps(_ENVIRONMENT))
    (folder / "world.json").write_text(json.dumps(_WORLD))
    return path
