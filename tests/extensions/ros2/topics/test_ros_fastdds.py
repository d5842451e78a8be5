"""A drone by Fast DDS, ROS 2's default middleware: what nobody here wrote speaks for itself."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from required import needs_peer, peer
from ros_domain import DOMAIN
from ros_drone import odometry_message
from waiting import until

from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.extensions.ros2.driver.camera import Ros2Camera
from aerodaas.extensions.ros2.driver.vehicle import Ros2Vehicle
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.link import RosLink
from aerodaas.messages.vehicle import FlightEnd, PositionSetpoint, VehicleMode
from aerodaas.simulation.dynamics import KinematicState

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_FASTDDS")]

SOURCES = Path(__file__).parent / "fastdds"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drone, compiled with types that Fast DDS's own generator makes of their definition."""
    folder = tmp_path_factory.mktemp("fastdds")
    for name in ("witness.idl", "drone.cpp"):
        (folder / name).write_bytes((SOURCES / name).read_bytes())
    generate = [peer("AERODAAS_FASTDDS"), "-replace", "witness.idl"]
    compiled = ["g++", "-std=c++14", "-o", "drone", "drone.cpp", "witness.cxx"]
    compiled += ["witnessPubSubTypes.cxx", "-lfastrtps", "-lfastcdr", "-lpthread"]
    for command in (generate, compiled):
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=250)
    return folder / "drone"


class FastDrone:
    """The program while it runs, and the lines that it printed."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.lines: list[list[str]] = []
        self._process = process
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.append(line.split())

    def said(self, kind: str) -> list[list[str]]:
        """Lines that begin with this word, without it."""
        return [line[1:] for line in self.lines if line[0] == kind]


@pytest.fixture
def drone(program: Path, topics: str) -> Iterator[FastDrone]:
    """It, in this test's domain, under its topics."""
    with subprocess.Popen(
        [str(program), str(DOMAIN), topics],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield FastDrone(process)
        finally:
            assert process.stdin is not None
            process.stdin.close()
            process.wait(10)


@pytest.mark.usefixtures("loopback_domain")
def test_it_is_flown_and_its_pictures_are_read(drone: FastDrone, topics: str) -> None:
    """Switched on, up, to a place with a heading, down, and switched off; all by its own word."""
    robot = RobotConfig.model_validate(
        {
            "id": "x3",
            "driver": "ros2",
            "limits": {"cruise_speed": 2.0},
            "settings": {
                "odometry": f"{topics}/odometry",
                "velocity": f"{topics}/cmd_vel",
                "enable": f"{topics}/enable",
                "landing_speed": 1.0,
            },
            "sensors": [{"id": "eye", "settings": {"topic": f"{topics}/image"}}],
        }
    )
    environment = EnvironmentConfig(robots=[robot])
    camera = Ros2Camera(robot.sensors[0], environment)
    camera.open()
    try:
        until(lambda: camera.model)
        pictures: list[Picture] = []

        def captured() -> bool:
            picture = camera.capture(10**12, None)
            pictures.extend([] if picture is None else [picture])
            return bool(pictures)

        until(captured)
        rgb = (np.arange(640 * 480 * 3) % 251).astype(np.uint8).reshape(480, 640, 3)
        np.testing.assert_array_equal(pictures[0].image, rgb[..., ::-1])
    finally:
        camera.close()
    vehicle = Ros2Vehicle(robot, environment)
    vehicle.connect()
    try:
        until(lambda: not vehicle.preflight())
        vehicle.take_off(1.0)
        until(lambda: vehicle.read().mode is VehicleMode.HOLDING)
        goal = PositionSetpoint(np.array([1.5, -0.8, 1.2]), 2.0)

        def there() -> bool:
            vehicle.send(goal)
            time.sleep(0.05)
            now = vehicle.read().odometry
            away = float(np.linalg.norm(now.position - goal.position))
            return away < 0.1 and abs(now.yaw - 2.0) < 0.1

        until(there)
        vehicle.land()
        until(lambda: vehicle.read().mode is VehicleMode.GROUNDED)
        assert vehicle.read().ended is FlightEnd.LANDED
        until(lambda: drone.said("enable")[-1] == ["0"])
        assert drone.said("enable")[0] == ["1"]
    finally:
        vehicle.close()


def test_it_hears_what_we_publish(ros_link: RosLink, drone: FastDrone, topics: str) -> None:
    """Odometry, raw and compressed pictures, figure by figure."""
    motion = KinematicState((1.25, -2.5, 3.75), (0.5, -0.25, 0.125), 0.0, 0.0, 0.0, 0.0)
    raw = bytes(index % 241 for index in range(320 * 240 * 3))
    header = types.ros_message("std_msgs/msg/Header", frame_id="eye")
    header.stamp.sec, header.stamp.nanosec = 7, 8
    pixels = np.frombuffer(raw, np.uint8)
    jpeg = cv2.imencode(".jpg", pixels.reshape(240, 320, 3))[1].reshape(-1)
    image = types.ros_message(
        types.IMAGE, header=header, height=240, width=320, encoding="bgr8", step=960, data=pixels
    )
    compressed = types.ros_message(types.COMPRESSED_IMAGE, header=header, format="jpeg", data=jpeg)
    messages = {
        "odometry": odometry_message(motion, 12_000_000_034),
        "image": image,
        "image/compressed": compressed,
    }
    told = {
        "odometry": "x3/odom x3/base_footprint 12.000000034 1.250000 -2.500000 3.750000 "
        "0.500000 -0.250000 0.125000",
        "image": f"eye 320x240 bgr8 {len(raw)} {sum(raw)}",
        "compressed": f"eye jpeg {len(jpeg)} {sum(jpeg.tolist())}",
    }
    for name, message in messages.items():
        publisher = ros_link.publisher(f"{topics}/heard/{name}", message.__msgtype__)
        until(partial(getattr, publisher, "listeners"))
        publisher.publish(message)
    until(lambda: all(drone.said(kind) for kind in told))
    assert {kind: " ".join(drone.said(kind)[0]) for kind in told} == told
