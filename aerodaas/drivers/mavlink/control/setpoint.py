"""Encoding of setpoints: SET_POSITION_TARGET_LOCAL_NED in the frame common to both autopilots."""

from __future__ import annotations

from typing import Any

from aerodaas.drivers.mavlink.control.guidance import Target
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.vehicle import VelocitySetpoint

__all__ = ["position_message", "velocity_message"]

_NO_ACCELERATION = 0b0000_0001_1100_0000
_PLACE_VELOCITY_YAW = _NO_ACCELERATION | 0b1000_0000_0000
"""Bits of the ignored fields: acceleration and yaw rate."""
_VELOCITY_YAW_RATE = _NO_ACCELERATION | 0b0100_0000_0111
"""The same: acceleration, position and yaw."""
_MASK32 = 0xFFFFFFFF


def position_message(
    target: Target,
    frame: LocalFrame,
    vehicle: tuple[int, int],
    now: float,
) -> Any:  # noqa: ANN401 - pymavlink has no types
    """Packet of the target's position, velocity and heading.

    Args:
        target: ENU metres, ENU m/s, radians.
        frame: Converts to the autopilot's frame.
        vehicle: System and component id.
        now: Monotonic clock, seconds.
    """
    north, east, down = frame.place(target.position)
    ahead, right, sinking = frame.velocity(target.velocity)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        int(now * 1e3) & _MASK32,
        *vehicle,
        mavlink.MAV_FRAME_LOCAL_NED,
        _PLACE_VELOCITY_YAW,
        *(north, east, down),
        *(ahead, right, sinking),
        *(0.0, 0.0, 0.0),
        frame.heading(target.yaw),
        0.0,
    )


def velocity_message(setpoint: VelocitySetpoint, vehicle: tuple[int, int], now: float) -> Any:  # noqa: ANN401 - pymavlink has no types
    """Packet of a velocity and a yaw rate.

    Args:
        setpoint: ENU m/s, rad/s.
        vehicle: System and component id.
        now: Monotonic clock, seconds.
    """
    return mavlink.MAVLink_set_position_target_local_ned_message(
        int(now * 1e3) & _MASK32,
        *vehicle,
        mavlink.MAV_FRAME_LOCAL_NED,
        _VELOCITY_YAW_RATE,
        *(0.0, 0.0, 0.0),
        *LocalFrame.velocity(setpoint.velocity),
        *(0.0, 0.0, 0.0),
        0.0,
        -setpoint.yaw_rate,
    )
