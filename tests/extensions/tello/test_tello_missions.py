"""Whole applications, actors and all, on an emulated Tello: only the robot's driver differs."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tello_apps
from ray import cloudpickle
from tello_apps import LimeVestFinder
from tello_flights import free_port

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint
from aerodaas.analytics import VipFollowAnalytics
from aerodaas.config.options import RunOptions, current_options
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import VehicleMode
from tools.tello_vehicle import EmulatedTello, TelloOptions, VideoOptions

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

# The actors' processes cannot import from the tests' folders.
cloudpickle.register_pickle_by_value(tello_apps)

ENVIRONMENT: dict[str, Any] = {
    "name": "campus",
    "robots": [
        {
            "id": "drone",
            "driver": "simulated",
            "limits": {"takeoff_height": 1.5, "cruise_speed": 0.8},
            "sensors": [
                {"id": "eye", "rate": 15},
                {"id": "odometry", "type": "odometry", "rate": 10},
            ],
        }
    ],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "campus", "seed": 0},
}


@pytest.fixture
def tello() -> Iterator[EmulatedTello]:
    """A Tello that films the campus."""
    video = VideoOptions(world="campus", width=480, height=360, rate=15.0)
    with EmulatedTello(TelloOptions(video=video)) as emulated:
        yield emulated


@pytest.fixture
def environment(tello: EmulatedTello, tmp_path: Path) -> Environment:
    """The environment with the robot's driver changed, and told where loopback's Tello is."""
    path = tmp_path / "environment.json"
    path.write_text(json.dumps(ENVIRONMENT))
    current_options.set(RunOptions(view=False, record=tmp_path / "flight"))
    return Environment(
        path,
        overrides={
            "drone.driver": "tello",
            "drone.settings": {
                "address": "127.0.0.1",
                "command_port": tello.port,
                "state_port": free_port(),
            },
            "eye.settings": {"video_port": free_port()},
        },
    )


def test_a_waypoint_mission(environment: Environment, tello: EmulatedTello) -> None:
    """Take off, visit, hover, come back, land; `rc` without a gap, no relative move ever."""
    drone = environment.get_robot_by_id("drone")
    stops = [Waypoint("a", 1.5, 0, 1.5), Waypoint("b", 1.5, 1.5, 1.8, hover_duration=1)]
    drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops))
    drone.start_mission()
    assert environment.run is not None
    assert environment.run.state is not None
    status = environment.run.state.robots["drone"].mission
    assert status.state is MissionState.LANDED
    assert status.visited == ("a", "b")
    assert tello.mode is VehicleMode.GROUNDED
    assert float(np.linalg.norm(tello.truth.position)) < 0.8, "home, as well as it knows"
    said = [text for _, text in tello.heard if not text.startswith("rc ")]
    assert [text.split()[0] for text in said] == ["command", "port", "streamon", "takeoff", "land"]
    stamps = [stamp for stamp, text in tello.heard if text.startswith("rc ")]
    assert max(np.diff(stamps)) < 1.0


def test_following_a_person_by_the_tellos_own_video(
    environment: Environment, tello: EmulatedTello
) -> None:
    """H.264 to detections to velocities to `rc`: it keeps up with the person who walks away."""
    drone = environment.get_robot_by_id("drone")
    edge = environment.get_compute_resource_by_id("edge")
    frames = drone.get_sensor_by_id("eye").get_data_stream()
    vest = LimeVestFinder().deploy(edge).analyse(frames)
    drone.navigate(VipFollowAnalytics(distance=2.0).deploy(edge).analyse(vest))
    drone.start_mission(wait=False)
    time.sleep(22.0)
    # The person sets out from x = 3 m after 8 s, at 0.7 m/s.
    assert tello.truth.position[0] > 4.0
    assert abs(tello.truth.position[1]) < 1.5
    drone.end_mission()
    drone.wait()
    assert tello.mode is VehicleMode.GROUNDED
