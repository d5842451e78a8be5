"""An emulated Tello with a driver and a camera on free ports of loopback."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from waiting import until

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.extensions.tello.camera import TelloCamera
from aerodaas.extensions.tello.vehicle import TelloVehicle
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from tools.tello_vehicle import EmulatedTello, TelloOptions

__all__ = ["LOOPBACK", "Pair", "flight", "free_port", "robot_of"]

LOOPBACK = "127.0.0.1"


def free_port(address: str = LOOPBACK) -> int:
    """A UDP port that nobody uses at present."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((address, 0))
        port: int = probe.getsockname()[1]
        return port


def robot_of(port: int, **settings: Any) -> RobotConfig:  # noqa: ANN401
    """A robot that flies the Tello at `port`; `camera=True` gives it a camera."""
    camera = settings.pop("camera", False)
    sensors = [{"id": "eye", "settings": {"video_port": free_port(), **camera}}] if camera else []
    return RobotConfig.model_validate(
        {
            "id": settings.pop("id", "tello"),
            "driver": "tello",
            "start": settings.pop("start", (0, 0, 0)),
            "start_yaw": settings.pop("start_yaw", 0.0),
            "sensors": sensors,
            "settings": {
                "address": LOOPBACK,
                "command_port": port,
                "state_port": free_port(),
                **settings,
            },
        }
    )


@dataclass
class Pair:
    """The two ends."""

    tello: EmulatedTello
    vehicle: TelloVehicle
    robot: RobotConfig
    environment: EnvironmentConfig

    def until(self, mode: VehicleMode, timeout: float = 15.0) -> VehicleState:
        """Wait until the driver reports `mode`."""
        until(lambda: self.vehicle.read().mode is mode, timeout)
        return self.vehicle.read()

    def take_off(self, height: float = 1.0) -> VehicleState:
        """Take off and wait until it hovers."""
        self.vehicle.take_off(height)
        return self.until(VehicleMode.HOLDING)

    def said(self, word: str) -> int:
        """How often the Tello heard a command that begins with `word`."""
        return sum(text.split()[0] == word for _, text in self.tello.heard)

    def camera(self) -> TelloCamera:
        """The robot's camera, not yet opened."""
        return TelloCamera(self.robot.sensors[0], self.environment)


@contextmanager
def flight(options: TelloOptions | None = None, **settings: Any) -> Iterator[Pair]:  # noqa: ANN401
    """Connect a driver with `settings` to an emulated Tello with `options`."""
    with EmulatedTello(options) as tello:
        robot = robot_of(tello.port, **settings)
        environment = EnvironmentConfig(robots=[robot])
        vehicle = TelloVehicle(robot, environment)
        vehicle.connect()
        try:
            yield Pair(tello, vehicle, robot, environment)
        finally:
            vehicle.close()
