"""Stream of setpoints, clipped to the vehicle's limits, with a check that they are followed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from aerodaas.config.model import RobotConfig
from aerodaas.drivers.mavlink.control.guidance import MovingTarget, Target
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.drivers.setpoints import slowed
from aerodaas.geometry.braking import limit_length
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import Setpoint, VelocitySetpoint

__all__ = ["Steering", "position_message", "velocity_message"]

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


_STREAM_GAP = 0.5
"""Seconds between setpoints after which the stream counts as restarted."""
_ASK_AGAIN = 2.0
"""Seconds after which guided flight is requested again."""


class Steering:
    """Stream of setpoints to one vehicle; called under the driver's lock."""

    def __init__(self, robot: RobotConfig, settings: MavlinkSettings) -> None:
        limits = robot.limits
        self._speed = min(limits.max_speed, settings.max_speed)
        self._cruise = min(limits.cruise_speed, self._speed)
        self.climb_rate = min(limits.max_climb, settings.max_climb)
        """m/s up and down at most."""
        self._turn_rate = math.radians(limits.max_yaw_rate)
        self._target = MovingTarget(limits.max_acceleration, self._turn_rate)
        self._stream_since = self._streamed_at = -math.inf
        self._guided_asked_at = -math.inf

    def message(
        self,
        setpoint: Setpoint,
        odometry: Odometry,
        frame: LocalFrame | None,
        target: tuple[int, int],
        now: float,
        *,
        waits: bool,
    ) -> tuple[Message, Setpoint]:
        """The packet for `target` and the setpoint as it was clipped.

        Args:
            setpoint: As it was sent to the driver.
            odometry: The vehicle's own.
            frame: Converts to the autopilot's frame; None, without a position, commands it to stand
                still.
            target: System and component id of the vehicle.
            now: Monotonic clock, seconds.
            waits: Whether it waits for its mode; the target of a flight stays with it then.
        """
        if now - self._streamed_at > _STREAM_GAP:
            self._stream_since = now
            self._target.forget()
        self._streamed_at = now
        if frame is None:
            return self._velocity(VelocitySetpoint(np.zeros(3)), target, now)
        if isinstance(setpoint, VelocitySetpoint):
            return self._velocity(setpoint, target, now)
        sent, speed = slowed(setpoint, self._cruise, self._speed)
        moved = self._target.towards(
            sent,
            speed,
            vehicle=odometry.position,
            velocity=odometry.velocity,
            facing=odometry.yaw,
            now=now,
            waits=waits,
        )
        return position_message(moved, frame, target, now), sent

    def _velocity(
        self, setpoint: VelocitySetpoint, target: tuple[int, int], now: float
    ) -> tuple[Message, Setpoint]:
        self._target.forget()
        across = limit_length(setpoint.velocity[:2], self._speed)
        up = float(np.clip(setpoint.velocity[2], -self.climb_rate, self.climb_rate))
        rate = float(np.clip(setpoint.yaw_rate, -self._turn_rate, self._turn_rate))
        sent = VelocitySetpoint(np.array([across[0], across[1], up]), rate)
        return velocity_message(sent, target, now), sent

    def see_to_guidance(
        self,
        phase: FlightPhase,
        stream_before: float,
        change: Callable[[FlightMode], None],
        now: float,
    ) -> None:
        """Switch to the guided mode, after a stream of setpoints.

        Until then a vehicle that flies a plan is stopped.

        Args:
            phase: Phase of the flight.
            stream_before: Seconds for which setpoints must have been sent.
            change: Asks for a flight mode.
            now: Monotonic clock, seconds.
        """
        if phase.wish is FlightMode.GUIDED and phase.seen:
            return
        if now - self._stream_since < stream_before:
            if phase.wish is FlightMode.MISSION:
                change(FlightMode.HOLD)
            return
        if phase.shown is FlightMode.GUIDED and phase.wish in {None, FlightMode.TAKE_OFF}:
            phase.ask(FlightMode.GUIDED, now)
        elif phase.wish is FlightMode.MISSION or now - self._guided_asked_at > _ASK_AGAIN:
            self._guided_asked_at = now
            change(FlightMode.GUIDED)
