"""An ArduCopter in guided mode, by pymavlink; places are metres east, north and up of home."""

from __future__ import annotations

import math
import time
from typing import Any

from pymavlink import mavutil

MAV: Any = mavutil.mavlink
TELEMETRY = (
    MAV.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    MAV.MAVLINK_MSG_ID_ATTITUDE,
    MAV.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    MAV.MAVLINK_MSG_ID_SYS_STATUS,
)
GUIDED = 4
PLACE_AND_YAW = 0b100111111000
PLACE_ONLY = 0b110111111000
NEAR = 0.3


class Copter:
    """One vehicle: its telemetry, and the commands that these programs need."""

    def __init__(self, url: str) -> None:
        self.link: Any = mavutil.mavlink_connection(url)
        self.link.wait_heartbeat()
        for message in TELEMETRY:
            self.command(MAV.MAV_CMD_SET_MESSAGE_INTERVAL, message, 50_000)
        while "LOCAL_POSITION_NED" not in self.link.messages:
            self.link.recv_match(blocking=True, timeout=1)

    def command(self, number: int, *values: float) -> None:
        """Command, and wait for the answer; raises RuntimeError if it is not accepted."""
        parameters = [*values, *[0.0] * (7 - len(values))]
        for _ in range(30):
            self.link.mav.command_long_send(
                self.link.target_system, self.link.target_component, number, 0, *parameters
            )
            answer = self.link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1)
            while answer is not None and answer.command != number:
                answer = self.link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1)
            if answer is not None and answer.result == MAV.MAV_RESULT_ACCEPTED:
                return
            time.sleep(1)
        raise RuntimeError(f"the vehicle does not accept command {number}")

    def newest(self, kind: str) -> Any:  # noqa: ANN401 - pymavlink has no types
        """The newest message of a kind."""
        while self.link.recv_msg() is not None:
            pass
        return self.link.messages[kind]

    @property
    def position(self) -> tuple[float, float, float]:
        """Where it is."""
        place = self.newest("LOCAL_POSITION_NED")
        return place.y, place.x, -place.z

    def take_off(self, height: float, speed: float) -> None:
        """Arm, rise to a height, and fly on at a speed."""
        self.command(MAV.MAV_CMD_DO_SET_MODE, MAV.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, GUIDED)
        self.command(MAV.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self.command(MAV.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height)
        while self.position[2] < height - NEAR:
            time.sleep(0.1)
        self.command(MAV.MAV_CMD_DO_CHANGE_SPEED, 1, speed, -1)

    def go_to(self, place: tuple[float, float, float], yaw: float | None = None) -> None:
        """Fly to a place, looking to `yaw` (radians counter-clockwise from east); send it again."""
        x, y, z = place
        facing = 0.0 if yaw is None else math.pi / 2 - yaw
        mask = PLACE_ONLY if yaw is None else PLACE_AND_YAW
        self.set_target(mask, y, x, -z, 0, 0, 0, 0, 0, 0, facing, 0)

    def set_target(self, mask: int, *values: float) -> None:
        """Send a setpoint: place, velocity, acceleration (NED), yaw and yaw rate."""
        vehicle = self.link.target_system, self.link.target_component
        self.link.mav.set_position_target_local_ned_send(
            0, *vehicle, MAV.MAV_FRAME_LOCAL_NED, mask, *values
        )

    def is_at(self, place: tuple[float, float, float]) -> bool:
        """Whether it has come to a place."""
        return math.dist(self.position, place) < NEAR

    def land(self) -> None:
        """Land here, and wait until the motors stand."""
        self.command(MAV.MAV_CMD_NAV_LAND)
        while self.newest("HEARTBEAT").base_mode & MAV.MAV_MODE_FLAG_SAFETY_ARMED:
            time.sleep(0.1)
