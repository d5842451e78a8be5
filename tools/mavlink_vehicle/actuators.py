"""Emulated gripper, servos, relays and parachute, which obey, refuse, stay silent or lie."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from aerodaas.drivers.mavlink.wire.dialect import mavlink

if TYPE_CHECKING:
    from tools.mavlink_vehicle.firmware import Firmware

__all__ = ["SILENT", "EmulatedActuators"]

SILENT = -1
"""In the place of a MAV_RESULT: no acknowledgement."""
_OK = mavlink.MAV_RESULT_ACCEPTED
_COMMANDS = {
    mavlink.MAV_CMD_DO_GRIPPER,
    mavlink.MAV_CMD_DO_SET_SERVO,
    mavlink.MAV_CMD_DO_SET_RELAY,
    mavlink.MAV_CMD_DO_PARACHUTE,
}
_SERVOS = 16
_RELAYS = 6
_MIDDLE = 1500


class EmulatedActuators:
    """Actuators of one vehicle; its attributes are what goes wrong with them."""

    def __init__(self, firmware: Firmware) -> None:
        """Carry what the firmware's options say."""
        self.carried = firmware.options.actuators
        self.conduct: Literal["obey", "refuse", "busy", "silent", "lie"] = "obey"
        """What it does with a command: `busy` says at first that it is in progress;
        `silent` does it and acknowledges nothing; `lie` acknowledges it and does nothing."""
        self.tells = True
        """Whether it answers what it puts out."""
        self.servos = [_MIDDLE] * _SERVOS
        """Microseconds by channel, from 1."""
        self.relays = [False] * _RELAYS
        self.gripped: bool | None = None
        self.parachute: int | None = None
        """The newest PARACHUTE_ACTION."""
        self.asked: list[tuple[int, float, float]] = []
        """Each command that arrived: its number, and its first two parameters."""
        self._firmware = firmware

    def obey(self, number: int, values: tuple[float, ...]) -> Any | None:  # noqa: ANN401
        """Obey a command; None for one that is not an actuator's."""
        if number not in _COMMANDS or not self.carried:
            return None
        self.asked.append((number, values[0], values[1]))
        if self.conduct == "refuse":
            return mavlink.MAV_RESULT_FAILED
        if self.conduct == "busy" and len(self.asked) == 1:
            return mavlink.MAV_RESULT_IN_PROGRESS
        if self.conduct != "lie":
            self._do(number, int(values[0]), int(values[1]))
        return SILENT if self.conduct == "silent" else _OK

    def _do(self, number: int, first: int, second: int) -> None:
        if number == mavlink.MAV_CMD_DO_GRIPPER:
            self.gripped = second == mavlink.GRIPPER_ACTION_GRAB
        elif number == mavlink.MAV_CMD_DO_SET_SERVO:
            self.servos[first - 1] = second
        elif number == mavlink.MAV_CMD_DO_SET_RELAY:
            self.relays[first] = bool(second)
        else:
            self.parachute = first
            if first == mavlink.PARACHUTE_RELEASE and self._firmware.armed:
                self._firmware.stop_motors()

    def message(self, number: int) -> Any | None:  # noqa: ANN401
        """Its message of that number; None if it has none."""
        if not (self.carried and self.tells):
            return None
        stamp = int(self._firmware.now * 1e3)
        if number == mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW:
            first, second = self.servos[:8], self.servos[8:]
            return mavlink.MAVLink_servo_output_raw_message(stamp * 1000, 0, *first, *second)
        if number == mavlink.MAVLINK_MSG_ID_RELAY_STATUS:
            on = sum(1 << index for index, one in enumerate(self.relays) if one)
            return mavlink.MAVLink_relay_status_message(stamp, on, (1 << _RELAYS) - 1)
        return None
