"""An emulated autopilot with a driver on free ports of loopback."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.types.geometry import Vector
from aerodaas.types.vehicle import PositionSetpoint, Setpoint, VehicleMode, VehicleState
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

__all__ = ["LOOPBACK", "Pair", "flight", "free_port", "robot_of", "wait_for"]

LOOPBACK = "127.0.0.1"


def free_port() -> int:
    """A UDP port that nobody uses at present."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def wait_for(condition: Callable[[], bool], timeout: float = 20.0) -> None:
    """Return when `condition` holds; fail the test if it never does."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def robot_of(port: int, **settings: Any) -> RobotConfig:  # noqa: ANN401
    """A robot that waits for its vehicle at `port`; `limits` and the like go to the robot."""
    own = {name: settings.pop(name) for name in ("remote_id", "preflight") if name in settings}
    return RobotConfig.model_validate(
        {
            "id": "drone",
            "driver": "mavlink",
            "limits": {"max_speed": 4.0, "cruise_speed": 2.0, **settings.pop("limits", {})},
            "start": settings.pop("start", (0, 0, 0)),
            **own,
            "settings": {"url": f"udpin:{LOOPBACK}:{port}", "ready_timeout": 15.0, **settings},
        }
    )


@dataclass
class Pair:
    """The two ends."""

    autopilot: EmulatedAutopilot
    vehicle: MavlinkVehicle
    robot: RobotConfig

    def until(self, *modes: VehicleMode, timeout: float = 20.0) -> VehicleState:
        """Wait until the driver reports one of `modes`."""
        wait_for(lambda: self.vehicle.read().mode in modes, timeout)
        return self.vehicle.read()

    def take_off(self, height: float = 2.0) -> VehicleState:
        """Take off and wait until it can be flown."""
        self.vehicle.take_off(height)
        return self.until(VehicleMode.HOLDING, VehicleMode.GUIDED)

    def stream(self, setpoint: Setpoint, duration: float) -> None:
        """Send at 20 Hz, as the drone's actor does."""
        for _ in range(round(duration / 0.05)):
            self.vehicle.read()
            self.vehicle.send(setpoint)
            time.sleep(0.05)

    def guide(self) -> None:
        """Take off and stream until the autopilot follows."""
        here = self.take_off().odometry.position
        for _ in range(200):
            self.vehicle.send(PositionSetpoint(here))
            time.sleep(0.05)
            if self.vehicle.read().mode is VehicleMode.GUIDED:
                return
        raise AssertionError("it never followed")

    def fly_to(self, place: Vector, yaw: float | None = None, speed: float = 2.0) -> float:
        """Fly until the driver believes to be there; the true distance left."""
        for _ in range(600):
            self.vehicle.send(PositionSetpoint(place, yaw, speed))
            time.sleep(0.05)
            odometry = self.vehicle.read().odometry
            faces = yaw is None or abs(odometry.yaw - yaw) < 0.1
            if float(np.linalg.norm(odometry.position - place)) < 0.15 and faces:
                return float(np.linalg.norm(self.autopilot.truth.position - place))
        raise AssertionError("never arrived")

    def heard(self, kind: str) -> list[Any]:
        """Messages of one kind that the autopilot got."""
        return [message for _, message in self.autopilot.heard if message.get_type() == kind]

    def commands(self, number: int) -> int:
        """How often the autopilot got a command."""
        kinds = ("COMMAND_LONG", "COMMAND_INT")
        return sum(one.command == number for kind in kinds for one in self.heard(kind))


@contextmanager
def flight(options: AutopilotOptions | None = None, **settings: Any) -> Iterator[Pair]:  # noqa: ANN401
    """Connect a driver with `settings` to an emulated autopilot with `options`."""
    port = free_port()
    options = replace(options or AutopilotOptions(), peer=(LOOPBACK, port))
    robot = robot_of(port, **settings)
    environment = EnvironmentConfig(robots=[robot])
    with EmulatedAutopilot(options) as autopilot:
        vehicle = MavlinkVehicle(robot, environment)
        vehicle.connect()
        try:
            yield Pair(autopilot, vehicle, robot)
        finally:
            vehicle.close()
