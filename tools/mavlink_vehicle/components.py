"""An emulated camera or gimbal with a MAVLink id of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.payload.mavlink.components import CAMERAS
from tools.mavlink_vehicle.firmware import Firmware
from tools.mavlink_vehicle.payload import EmulatedPayload

__all__ = ["EmulatedComponent"]

_HEARTBEAT = 1.0
"""Seconds between its heartbeats, each with the manager's status where it is a gimbal."""
_STREAM = 0.2
"""Seconds between two attitudes of a gimbal that was asked for no other rate."""
_ATTITUDE = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS
_FORMER = {
    mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION: mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION,
    mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION: mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION,
    mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS,
    mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION: (
        mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION
    ),
}
_MANAGER = mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS


class EmulatedComponent:
    """One component; its attributes, and those of its payload, are what goes wrong with it."""

    def __init__(self, firmware: Firmware, number: int, say_as: Callable[[Any, int], None]) -> None:
        """Speak as component `number` by `say_as`."""
        self.vanished = False
        """It says and hears nothing."""
        self.stalls = False
        """It beats, and answers nothing."""
        self.former = False
        """It knows the requests that came before MAV_CMD_REQUEST_MESSAGE, and not that."""
        self.heard: list[Any] = []
        """Every message for it."""
        camera = number in CAMERAS
        self.say: Callable[[Any], None] = lambda message: say_as(message, number)
        """Sends a message of its own."""
        self.payload = EmulatedPayload(firmware, self.say, gimbal=not camera, camera=camera)
        self.payload.device = number
        self.payload.by_itself = True
        self.payload.flags = mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
        self._kind = mavlink.MAV_TYPE_CAMERA if camera else mavlink.MAV_TYPE_GIMBAL
        self._attitude = 0.0 if camera else _STREAM
        """Seconds between two attitudes; 0 for none."""
        self._beat_due = self._attitude_due = 0.0

    def hear(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Obey a message for this component."""
        if self.vanished:
            return
        self.heard.append(message)
        kind = message.get_type()
        if self.stalls:
            return
        if kind == "GIMBAL_MANAGER_SET_PITCHYAW":
            self.payload.track(message)
        elif kind == "COMMAND_LONG":
            values = tuple(getattr(message, f"param{index}") for index in range(1, 8))
            result = self._obey(message.command, values)
            peer = (message.get_srcSystem(), message.get_srcComponent())
            self.say(mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *peer))

    def _obey(self, number: int, values: tuple[float, ...]) -> Any:  # noqa: ANN401
        if number == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and values[0] == _ATTITUDE:
            self._attitude = values[1] / 1e6
            return mavlink.MAV_RESULT_ACCEPTED
        requested = _FORMER.get(number) if self.former else None
        if number == mavlink.MAV_CMD_REQUEST_MESSAGE and not self.former:
            requested = int(values[0])
        if requested is not None:
            said = self.payload.message(requested)
            if said is None:
                return mavlink.MAV_RESULT_UNSUPPORTED
            self.say(said)
            return mavlink.MAV_RESULT_ACCEPTED
        result = self.payload.obey(number, values)
        return mavlink.MAV_RESULT_UNSUPPORTED if result is None else result

    def turn(self, now: float) -> None:
        """Beat, turn and take pictures at `now`, seconds of the link's clock."""
        if self.vanished:
            return
        if now >= self._beat_due:
            self._beat_due = now + _HEARTBEAT
            self.say(
                mavlink.MAVLink_heartbeat_message(
                    self._kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
                )
            )
            self._tell(_MANAGER)
        self.payload.advance()
        if self._attitude and now >= self._attitude_due:
            self._attitude_due = now + self._attitude
            self._tell(_ATTITUDE)

    def _tell(self, number: int) -> None:
        said = self.payload.message(number)
        if said is not None:
            self.say(said)
