"""MAVLink's commands and frames in plans: numbers, names, and what becomes of them."""

from __future__ import annotations

import functools
import importlib
from typing import Any

__all__ = [
    "DO_CHANGE_SPEED",
    "DO_DIGICAM_CONTROL",
    "DO_GIMBAL_MANAGER_PITCHYAW",
    "DO_GRIPPER",
    "DO_MOUNT_CONTROL",
    "DO_SET_CAM_TRIGG_DIST",
    "DO_SET_CAM_TRIGG_INTERVAL",
    "DO_SET_RELAY",
    "DO_SET_ROI",
    "DO_SET_ROI_LOCATION",
    "DO_SET_ROI_NONE",
    "DO_SET_ROI_WPNEXT_OFFSET",
    "DO_SET_SERVO",
    "FRAMES_ABOVE_GROUND",
    "FRAMES_ABOVE_SEA",
    "FRAMES_RELATIVE",
    "FRAME_ABOVE_GROUND",
    "FRAME_ABOVE_SEA",
    "FRAME_MISSION",
    "FRAME_RELATIVE",
    "IMAGE_START_CAPTURE",
    "IMAGE_STOP_CAPTURE",
    "MOUNT_MAVLINK_TARGETING",
    "MOUNT_NEUTRAL",
    "NAV_DELAY",
    "NAV_LAND",
    "NAV_LAST",
    "NAV_LOITER_TIME",
    "NAV_RETURN_TO_LAUNCH",
    "NAV_SPLINE_WAYPOINT",
    "NAV_TAKEOFF",
    "NAV_VTOL_LAND",
    "NAV_VTOL_TAKEOFF",
    "NAV_WAYPOINT",
    "OF_RANGE",
    "SET_CAMERA_FOCUS",
    "SET_CAMERA_ZOOM",
    "VIDEO_START_CAPTURE",
    "VIDEO_STOP_CAPTURE",
    "command_name",
    "why_not",
]

NAV_WAYPOINT = 16
NAV_LOITER_TIME = 19
NAV_RETURN_TO_LAUNCH = 20
NAV_LAND = 21
NAV_TAKEOFF = 22
NAV_SPLINE_WAYPOINT = 82
NAV_VTOL_TAKEOFF = 84
NAV_VTOL_LAND = 85
NAV_DELAY = 93
NAV_LAST = 95
"""Commands up to here say where to fly; later ones what to do on the way."""
DO_CHANGE_SPEED = 178
DO_SET_RELAY = 181
DO_SET_SERVO = 183
DO_SET_ROI_LOCATION = 195
DO_SET_ROI_WPNEXT_OFFSET = 196
DO_SET_ROI_NONE = 197
DO_SET_ROI = 201
DO_DIGICAM_CONTROL = 203
DO_MOUNT_CONTROL = 205
DO_SET_CAM_TRIGG_DIST = 206
DO_GRIPPER = 211
DO_SET_CAM_TRIGG_INTERVAL = 214
SET_CAMERA_ZOOM = 531
SET_CAMERA_FOCUS = 532
DO_GIMBAL_MANAGER_PITCHYAW = 1000
IMAGE_START_CAPTURE = 2000
IMAGE_STOP_CAPTURE = 2001
VIDEO_START_CAPTURE = 2500
VIDEO_STOP_CAPTURE = 2501

OF_RANGE = 2.0
"""CAMERA_ZOOM_TYPE and SET_FOCUS_TYPE of percent of the lens's range."""
MOUNT_NEUTRAL = 1
MOUNT_MAVLINK_TARGETING = 2
"""MAV_MOUNT_MODE of angles."""

FRAME_MISSION = 2
"""Of a command without a place."""
FRAME_RELATIVE = 3
FRAMES_RELATIVE = (FRAME_RELATIVE, 6)
FRAME_ABOVE_SEA = 0
FRAMES_ABOVE_SEA = (FRAME_ABOVE_SEA, 5)
FRAME_ABOVE_GROUND = 10
FRAMES_ABOVE_GROUND = (FRAME_ABOVE_GROUND, 11)

_CAMERA = "no picture is taken by it; the application's camera streams all the way"
_GIMBAL = "no gimbal is moved by it; it stays as it is"
_PAYLOAD = "no payload is moved"
_WHY = {
    112: "the next command does not wait",  # CONDITION_DELAY
    113: "the next command does not wait",  # CONDITION_CHANGE_ALT
    114: "the next command does not wait",  # CONDITION_DISTANCE
    115: "the drone does not turn; give the waypoints a yaw",  # CONDITION_YAW
    177: "the way is flown once",  # DO_JUMP
    179: "home stays where it is",  # DO_SET_HOME
    181: _PAYLOAD,  # DO_SET_RELAY
    182: _PAYLOAD,  # DO_REPEAT_RELAY
    183: _PAYLOAD,  # DO_SET_SERVO
    184: _PAYLOAD,  # DO_REPEAT_SERVO
    196: _GIMBAL,  # DO_SET_ROI_WPNEXT_OFFSET
    197: _GIMBAL,  # DO_SET_ROI_NONE
    201: _GIMBAL,  # DO_SET_ROI
    202: _CAMERA,  # DO_DIGICAM_CONFIGURE
    203: _CAMERA,  # DO_DIGICAM_CONTROL
    204: _GIMBAL,  # DO_MOUNT_CONFIGURE
    207: "the fence is the environment file's",  # DO_FENCE_ENABLE
    208: _PAYLOAD,  # DO_PARACHUTE
    211: _PAYLOAD,  # DO_GRIPPER
    530: _CAMERA,  # SET_CAMERA_MODE
    1001: _GIMBAL,  # DO_GIMBAL_MANAGER_CONFIGURE
}


def why_not(command: int) -> str:
    """Say what comes of a command that is not carried out."""
    return _WHY.get(command, "it is not carried out")


def command_name(command: int) -> str:
    """MAVLink's name of a command, without MAV_CMD; of an unknown one, its number."""
    known = _names().get(command)
    return f"command {command}" if known is None else str(known.name).removeprefix("MAV_CMD_")


@functools.cache
def _names() -> dict[int, Any]:
    names: dict[int, Any] = importlib.import_module("pymavlink.dialects.v20.ardupilotmega").enums[
        "MAV_CMD"
    ]
    return names
