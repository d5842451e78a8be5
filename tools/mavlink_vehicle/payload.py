"""An emulated gimbal and camera by the protocols v2, as autopilots have them on board."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink

if TYPE_CHECKING:
    from tools.mavlink_vehicle.firmware import Firmware

__all__ = ["EmulatedPayload"]

_OK = mavlink.MAV_RESULT_ACCEPTED
_RATE = math.radians(60.0)
"""rad/s at which it turns."""
_DEVICE = 1
_LOWEST, _HIGHEST, _WIDEST = math.radians(-90.0), math.radians(20.0), math.radians(170.0)
_AXES = (
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_ROLL_AXIS | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS
)
_YAW_AXIS = mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS
_LENS = {mavlink.MAV_CMD_SET_CAMERA_ZOOM: "zoom", mavlink.MAV_CMD_SET_CAMERA_FOCUS: "focus"}
_SHUTTER = 0.3
"""Seconds from a request to the word of its picture."""


class EmulatedPayload:
    """Gimbal and camera of one vehicle; its attributes are what goes wrong with them."""

    def __init__(
        self, firmware: Firmware, say: Callable[[Any], None], *, gimbal: bool, camera: bool
    ) -> None:
        """Carry a gimbal, a camera, or both; `say` sends a message."""
        self.has_gimbal, self.has_camera = gimbal, camera
        self.device = _DEVICE
        """Id of the gimbal's device."""
        self.flags = 0
        """CAMERA_CAP_FLAGS that the camera tells."""
        self.free: float | None = None
        """MiB left on the camera's card; None: it tells nothing of it."""
        self.video = ""
        """Address that the camera tells of its video."""
        self.by_itself = False
        """The camera tells of its pictures by CAMERA_IMAGE_CAPTURED, whatever the autopilot is."""
        self.gimbal_refuses = self.camera_refuses = False
        self.stuck = False
        """It acknowledges and does not turn."""
        self.turns = True
        """It has a yaw axis."""
        self.tracked = 0
        """Targets that came without a command."""
        self.nonsense = False
        """Its attitude is not a number."""
        self.lens: dict[str, float] = {}
        """Percent of zoom and focus, as set."""
        self.lens_refuses = False
        self.mute = False
        """Pictures are taken, and not told."""
        self.knows_height = True
        """Pictures have an altitude, and not zero in its place."""
        self.interval: float | None = None
        """Seconds between pictures that it says that it takes by itself."""
        self.recording: float | None = None
        """Seconds for which it says that it has been recording video."""
        self.video_refuses = False
        self.video_sticks = False
        """Video is acknowledged, and what it does stays as it is."""
        self._filming_since: float | None = None
        self.counts = True
        """It tells how many pictures it has taken."""
        self.blind = False
        """Pictures are acknowledged, and not taken."""
        self.pitch = self.right = 0.0
        """Where it looks: radians, up and to the right of the nose."""
        self.controller: tuple[float, float] | None = None
        self.taken: list[float] = []
        """Pitch of each picture."""
        self._wanted = (0.0, 0.0)
        self._firmware = firmware
        self._say = say
        self._due: list[float] = []
        self._then = 0.0

    def obey(self, number: int, values: tuple[float, ...]) -> Any | None:  # noqa: ANN401
        """Obey a command; None for one that is not a gimbal's or a camera's."""
        if number == mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE and self.has_gimbal:
            self.controller = values[0], values[1]
            return _OK
        if number == mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW and self.has_gimbal:
            if self.gimbal_refuses or self.controller is None:
                return mavlink.MAV_RESULT_DENIED
            self._turn_to(*(math.radians(value) for value in values[:2]))
            return _OK
        return self._obey_camera(number, values) if self.has_camera else None

    def _obey_camera(self, number: int, values: tuple[float, ...]) -> Any | None:  # noqa: ANN401
        if number in _LENS:
            if self.lens_refuses or values[0] != mavlink.ZOOM_TYPE_RANGE:
                return mavlink.MAV_RESULT_DENIED
            self.lens[_LENS[number]] = values[1]
            return _OK
        if number in {mavlink.MAV_CMD_VIDEO_START_CAPTURE, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE}:
            return self._film(on=number == mavlink.MAV_CMD_VIDEO_START_CAPTURE)
        if number == mavlink.MAV_CMD_IMAGE_START_CAPTURE:
            if self.camera_refuses:
                return mavlink.MAV_RESULT_FAILED
            if not self.blind:
                self._due.append(self._firmware.now + _SHUTTER)
            return _OK
        return None

    def _film(self, *, on: bool) -> Any:  # noqa: ANN401
        if self.video_refuses:
            return mavlink.MAV_RESULT_DENIED
        if not self.video_sticks:
            self.recording = 0.0 if on else None
            self._filming_since = self._firmware.now if on else None
        return _OK

    def track(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Turn as a GIMBAL_MANAGER_SET_PITCHYAW says, which nothing answers."""
        if self.has_gimbal and not self.gimbal_refuses and self.controller is not None:
            self.tracked += 1
            self._turn_to(message.pitch, message.yaw)

    def _turn_to(self, pitch: float, right: float) -> None:
        widest = _WIDEST if self.turns else 0.0
        self._wanted = min(max(pitch, _LOWEST), _HIGHEST), min(max(right, -widest), widest)

    def advance(self) -> None:
        """Let time pass until the firmware's."""
        now = self._firmware.now
        most = _RATE * max(0.0, now - self._then)
        self._then = now
        if not self.stuck:
            self.pitch += min(max(self._wanted[0] - self.pitch, -most), most)
            self.right += min(max(self._wanted[1] - self.right, -most), most)
        if self._filming_since is not None and self.recording is not None:
            self.recording = now - self._filming_since
        while self._due and now >= self._due[0]:
            self._due.pop(0)
            self._take()

    def _take(self) -> None:
        flight = self._firmware.flight
        self.taken.append(self.pitch)
        lat, lon, _ = flight.origin.to_geodetic(flight.believed.position)
        stamp, place = round(self._firmware.now * 1e3), (round(lat * 1e7), round(lon * 1e7))
        index, altitude = len(self.taken), flight.altitude if self.knows_height else 0.0
        if self.mute:
            return
        if self.by_itself or self._firmware.number == mavlink.MAV_AUTOPILOT_PX4:
            name = f"DCIM/{index:04d}.JPG".encode()
            height = (round(altitude * 1e3), 0)
            self._say(
                mavlink.MAVLink_camera_image_captured_message(
                    stamp, 0, 1, *place, *height, self._quaternion(), index - 1, 1, name
                )
            )
            return
        self._say(
            mavlink.MAVLink_camera_feedback_message(
                *(stamp * 1000, 0, 0, index, *place, altitude, 0.0),
                *(0.0, math.degrees(self.pitch), 0.0, 0.0, 0),
            )
        )

    def message(self, number: int) -> Any | None:  # noqa: ANN401
        """Its message of that number; None if it has none."""
        stamp = round(self._firmware.now * 1e3)
        if number == mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION and self.has_gimbal:
            widest, able = (_WIDEST, _AXES | _YAW_AXIS) if self.turns else (0.0, _AXES)
            ranges = (0.0, 0.0, _LOWEST, _HIGHEST, -widest, widest)
            return mavlink.MAVLink_gimbal_manager_information_message(
                stamp, able, self.device, *ranges
            )
        if number == mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_INFORMATION and self.has_gimbal:
            return self._gimbal_device(stamp)
        if number == mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS and self.has_gimbal:
            controller = tuple(max(0, round(value)) for value in self.controller or (0.0, 0.0))
            return mavlink.MAVLink_gimbal_manager_status_message(
                stamp, 0, self.device, *controller, 0, 0
            )
        if number == mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS and self.has_gimbal:
            flags = mavlink.GIMBAL_DEVICE_FLAGS_PITCH_LOCK | mavlink.GIMBAL_DEVICE_FLAGS_ROLL_LOCK
            unknown = (math.nan, math.nan, math.nan)
            return mavlink.MAVLink_gimbal_device_attitude_status_message(
                0, 0, stamp, flags, self._quaternion(), *unknown, 0
            )
        return self._camera_message(number, stamp)

    def _gimbal_device(self, stamp: int) -> Any:  # noqa: ANN401
        name = b"emulated"
        able = _AXES | (_YAW_AXIS if self.turns else 0)
        widest = _WIDEST if self.turns else 0.0
        ranges = (0.0, 0.0, _LOWEST, _HIGHEST, -widest, widest)
        return mavlink.MAVLink_gimbal_device_information_message(
            stamp, name, name, b"", 0, 0, 0, able, 0, *ranges
        )

    def _camera_message(self, number: int, stamp: int) -> Any | None:  # noqa: ANN401
        if number == mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION and self.free is not None:
            ready = mavlink.STORAGE_STATUS_READY
            return mavlink.MAVLink_storage_information_message(
                stamp, 1, 1, ready, 32_000.0, 32_000.0 - self.free, self.free, 90.0, 60.0
            )
        if number == mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION and self.video:
            return mavlink.MAVLink_video_stream_information_message(
                1, 1, 0, 1, 30.0, 1920, 1080, 4_000_000, 0, 80, b"main", self.video.encode()
            )
        if number == mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION and self.has_camera:
            name = list(b"emulated".ljust(32, b"\0"))
            return mavlink.MAVLink_camera_information_message(
                stamp, name, name, 0, 8.8, 13.2, 8.8, 5472, 3648, 0, self._told_flags, 0, b""
            )
        if number == mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS and self.has_camera:
            return self._capture_status(stamp) if self.counts else None
        return None

    def _capture_status(self, stamp: int) -> Any:  # noqa: ANN401
        by_interval, recording = self.interval is not None, self.recording is not None
        return mavlink.MAVLink_camera_capture_status_message(
            *(stamp, 2 * by_interval, int(recording), self.interval or 0.0),
            *(round(1e3 * (self.recording or 0.0)), self.free or 0.0, len(self.taken)),
        )

    @property
    def _told_flags(self) -> int:
        films: int = mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM if self.video else 0
        takes: int = mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE if films else 0
        return self.flags | films | takes

    def _quaternion(self) -> list[float]:
        if self.nonsense:
            return [math.nan] * 4
        pitch, yaw = self.pitch / 2, self.right / 2
        return [
            math.cos(pitch) * math.cos(yaw),
            -math.sin(pitch) * math.sin(yaw),
            math.sin(pitch) * math.cos(yaw),
            math.cos(pitch) * math.sin(yaw),
        ]
