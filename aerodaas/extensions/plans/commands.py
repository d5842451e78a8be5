"""MAVLink's commands and frames in plans: numbers, names, and what becomes of them."""

from __future__ import annotations

from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = [
    "FRAMES_ABOVE_GROUND",
    "FRAMES_ABOVE_SEA",
    "FRAMES_RELATIVE",
    "FRAME_ABOVE_GROUND",
    "FRAME_ABOVE_SEA",
    "FRAME_MISSION",
    "FRAME_RELATIVE",
    "MOUNT_MAVLINK_TARGETING",
    "MOUNT_NEUTRAL",
    "command_name",
    "why_not",
]

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
_LENS = "the lens stays as it is; give the waypoints zoom and focus"
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
    531: _LENS,  # SET_CAMERA_ZOOM
    532: _LENS,  # SET_CAMERA_FOCUS
    1001: _GIMBAL,  # DO_GIMBAL_MANAGER_CONFIGURE
}


def why_not(command: int) -> str:
    """Say what comes of a command that is not carried out."""
    return _WHY.get(command, "it is not carried out")


def command_name(command: int) -> str:
    """MAVLink's name of a command, without MAV_CMD; of an unknown one, its number."""
    known = mavlink.enums["MAV_CMD"].get(command)
    return f"command {command}" if known is None else str(known.name).removeprefix("MAV_CMD_")
