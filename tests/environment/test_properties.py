"""Properties of sensors and compute resources, as an application queries them on the ground."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, ClassVar

import pytest
from flying import FLAT, robot
from pydantic import BaseModel

from aerodaas import Environment, NearestNeighborScheduler
from aerodaas.errors import ConfigError, UnknownIdError

CAMERA = {"id": "cam", "rate": 5, "settings": {"width": 64}}
COMPUTE = [
    {"id": "edge", "settings": {"power": 15}},
    {"id": "far", "kind": "cloud", "node": "203.0.113.7"},
    {"id": "lambda", "kind": "http", "endpoint": {"url": "https://example.com/detect"}},
]


class Lidar:
    """A camera plug-in of an application, without a model of its settings."""


class LidarSettings(BaseModel):
    """Settings of the following one."""

    channels: int = 16


class CheckedLidar:
    """A camera plug-in with a model of its settings."""

    settings_model: ClassVar = LidarSettings


@pytest.fixture
def env(tmp_path: Path) -> Environment:
    """A drone with a camera and odometry, and cameras of an application's own."""
    own = [
        {"id": "plain", "driver": f"{__name__}:Lidar", "settings": {"beams": 4}},
        {"id": "checked", "driver": f"{__name__}:CheckedLidar"},
        {"id": "wrong", "driver": f"{__name__}:CheckedLidar", "settings": {"channels": "many"}},
    ]
    drone = robot(sensors=[CAMERA, {"id": "odom", "type": "odometry", "rate": 10}])
    content: dict[str, Any] = {**FLAT, "robots": [drone], "sensors": own, "compute": COMPUTE}
    path = tmp_path / "environment.json"
    path.write_text(json.dumps(content))
    return Environment(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("id", "cam"),
        ("type", "camera"),
        ("driver", "simulated"),
        ("rate", "5.0"),
        ("robot", "drone"),
        ("width", "64"),
        ("height", "360"),
        ("horizontal_fov", "82.6"),
    ],
)
def test_a_camera_has_the_settings_of_its_driver(env: Environment, name: str, value: str) -> None:
    """Those of the file, and the defaults of the others."""
    camera = env.get_robot_by_id("drone").get_sensor_by_id("cam")
    assert camera.get_sensor_property(name) == value
    assert env.get_env_sensor_by_id("cam").get_sensor_property(name) == value


def test_other_sensors_have_no_driver_settings(env: Environment) -> None:
    """An unknown property is an error that lists the known ones."""
    odometry = env.get_robot_by_id("drone").get_sensor_by_id("odom")
    assert odometry.get_sensor_property("rate") == "10.0"
    with pytest.raises(UnknownIdError, match=r"width.*known: driver, id, rate, robot, type"):
        odometry.get_sensor_property("width")


def test_a_plug_in_of_the_application_says_its_own(env: Environment) -> None:
    """With defaults if its class names a model; an invalid setting is refused."""
    assert env.get_env_sensor_by_id("plain").get_sensor_property("beams") == "4"
    assert env.get_env_sensor_by_id("plain").get_sensor_property("robot") == ""
    assert env.get_env_sensor_by_id("checked").get_sensor_property("channels") == "16"
    with pytest.raises(ConfigError, match=r"sensor wrong: settings: channels: .*'many'"):
        env.get_env_sensor_by_id("wrong").get_sensor_property("channels")


@pytest.mark.usefixtures("runtime")
def test_the_hardware_of_this_machine(env: Environment) -> None:
    """Ray's account of it beside the file's settings."""
    edge = env.get_compute_resource_by_id("edge")
    told = edge.get_compute_properties()
    assert edge.get_compute_id() == told["id"] == "edge"
    assert (told["kind"], told["power"], told["executors"]) == ("edge", 15, 1)
    assert told["nodes"] == 1
    assert told["cores"] == os.cpu_count()
    assert 2**28 < told["memory"] < os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert not {"CPU", "memory", "edge", "cloud", "object_store_memory"} & set(told["accelerators"])


@pytest.mark.usefixtures("runtime")
def test_a_resource_without_a_node(env: Environment) -> None:
    """A node that the cluster lacks is an error; an endpoint has none to describe."""
    with pytest.raises(ConfigError, match=r"no node of the cluster is called '203\.0\.113\.7'"):
        env.get_compute_resource_by_id("far").get_compute_properties()
    told = env.get_compute_resource_by_id("lambda").get_compute_properties()
    assert told["endpoint"]["url"] == "https://example.com/detect"
    assert not {"cores", "memory", "accelerators"} & set(told)


@pytest.mark.parametrize(
    "given",
    [
        "nearest_neighbor",
        "aerodaas.schedulers.trajectory.nearest_neighbor:NearestNeighborScheduler",
        NearestNeighborScheduler,
        NearestNeighborScheduler(),
    ],
    ids=["name", "module", "class", "instance"],
)
def test_a_trajectory_scheduler_is_set_as_an_analytics_one_is(
    env: Environment, given: str | type[NearestNeighborScheduler] | NearestNeighborScheduler
) -> None:
    """By name, by module and class, by class, and by instance."""
    env.set_trajectory_scheduler(given)
    assert isinstance(env.trajectory_scheduler(), NearestNeighborScheduler)


def test_what_is_no_trajectory_scheduler_is_refused(env: Environment) -> None:
    """A wrong name with those that are close, anything else by its kind."""
    with pytest.raises(UnknownIdError, match="did you mean nearest_neighbor"):
        env.set_trajectory_scheduler("nearest")
    with pytest.raises(ConfigError, match="not int"):
        env.set_trajectory_scheduler(5)  # type: ignore[arg-type]
