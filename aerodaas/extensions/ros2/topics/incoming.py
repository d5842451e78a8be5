"""Values of ROS 2 messages of anyone, checked; of bags as of live topics."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import RecordingError
from aerodaas.geometry.frames import Vector, is_finite, rotation_from_rpy
from aerodaas.messages.odometry import Battery, GpsFix, Odometry

__all__ = [
    "battery_of",
    "euler_of",
    "fix_of",
    "odometry_of",
    "stamp_of",
]

_UNIT = 1e-2
"""How far a quaternion's length may be from one."""
_FARTHEST = 1e7
"""Metres and metres per second: beyond, a figure is no place near the Earth."""
_STEEP = 1e-3
"""Cosine of the pitch below which a yaw's rate is not told from a roll's."""
_FOREIGN = re.compile(r"(?:^|[_/])(?:ned|frd)(?:$|[_/])", re.IGNORECASE)
"""Names of frames that are not ours, as MAVROS calls them: `odom_ned`, `base_link_frd`."""
_EARTH = (-90.0, 90.0), (-180.0, 180.0)


def stamp_of(message: Any) -> int:  # noqa: ANN401 - a type made at run time
    """Stamp of a message's header, nanoseconds; zero where none was set."""
    stamp = message.header.stamp
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def odometry_of(message: Any) -> Odometry:  # noqa: ANN401
    """Odometry of a `nav_msgs/Odometry`, whose frames are those of REP 103: ENU, and FLU.

    The velocity is turned from the body's own axes into ENU. The yaw's rate follows from the body's
    rates by the kinematics of z-y-x angles.

    Raises:
        ValueError: If a figure is not finite, or the quaternion not of length one.
        RecordingError: If a frame is named as NED or FRD: every sign would be wrong.
    """
    for name in (message.header.frame_id, message.child_frame_id):
        if _FOREIGN.search(name):
            raise RecordingError(
                f"the odometry is in the frame {name!r}; give a topic in ENU and FLU (REP 103), as "
                "MAVROS' local_position/odom"
            )
    pose, twist = message.pose.pose, message.twist.twist
    roll, pitch, yaw = euler_of(pose.orientation)
    position = _vector(pose.position)
    velocity = rotation_from_rpy(roll, pitch, yaw) @ _vector(twist.linear)
    _, about_left, about_up = _vector(twist.angular)
    rate = about_left * math.sin(roll) + about_up * math.cos(roll)
    steep = abs(math.cos(pitch)) < _STEEP
    variance = max(float(message.pose.covariance[place]) for place in (0, 7))
    yaw_rate = 0.0 if steep else rate / math.cos(pitch)
    return Odometry(position, velocity, yaw, roll, pitch, yaw_rate, _sigma(variance))


def euler_of(quaternion: Any) -> tuple[float, float, float]:  # noqa: ANN401
    """Roll, pitch and yaw, intrinsic z-y-x in radians, of a `geometry_msgs/Quaternion`.

    Raises:
        ValueError: If its length is not one.
    """
    parts = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    length = math.hypot(*parts)
    if not abs(length - 1.0) <= _UNIT:
        raise ValueError(f"a quaternion of length {length:.3g}")
    x, y, z, w = (part / length for part in parts)
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


def fix_of(message: Any) -> GpsFix:  # noqa: ANN401
    """Fix of a `sensor_msgs/NavSatFix`.

    Raises:
        ValueError: If there is no fix, or it is nowhere on the Earth.
    """
    if message.status.status < message.status.STATUS_FIX:
        raise ValueError("no fix")
    place = float(message.latitude), float(message.longitude)
    if not all(low <= angle <= high for angle, (low, high) in zip(place, _EARTH, strict=True)):
        raise ValueError(f"a fix at {place}")
    altitude = float(message.altitude)
    if not abs(altitude) <= _FARTHEST:
        raise ValueError(f"a fix at the altitude {altitude}")
    known = message.position_covariance_type != message.COVARIANCE_TYPE_UNKNOWN
    east, north, up = (float(message.position_covariance[place]) for place in (0, 4, 8))
    return GpsFix(
        *place,
        altitude,
        _sigma(max(east, north)) if known else 0.0,
        _sigma(up) if known else 0.0,
    )


def battery_of(message: Any) -> Battery:  # noqa: ANN401
    """Battery of a `sensor_msgs/BatteryState`; what was not measured is zero, a charge NaN."""
    fraction, voltage, current = (
        float(one) for one in (message.percentage, message.voltage, message.current)
    )
    return Battery(
        fraction if 0.0 <= fraction <= 1.0 else math.nan,
        voltage if math.isfinite(voltage) else 0.0,
        -current if math.isfinite(current) and current else 0.0,
    )


def _vector(value: Any) -> Vector:  # noqa: ANN401
    vector = np.array([value.x, value.y, value.z], dtype=np.float64)
    if not is_finite(vector) or np.abs(vector).max() > _FARTHEST:
        raise ValueError(f"a vector of {vector}")
    return vector


def _sigma(variance: float) -> float:
    return math.sqrt(variance) if 0 < variance < _FARTHEST else 0.0
