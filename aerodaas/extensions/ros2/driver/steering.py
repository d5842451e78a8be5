"""Velocities and switches as messages."""

from __future__ import annotations

import math

import numpy as np

from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.extensions.ros2.driver.frames import Alignment, velocity_in
from aerodaas.extensions.ros2.driver.settings import Ros2Settings
from aerodaas.extensions.ros2.topics.link import RosLink
from aerodaas.extensions.ros2.topics.types import BOOL, TWIST, TWIST_STAMPED, ros_message
from aerodaas.geometry.frames import is_finite
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import VelocitySetpoint

__all__ = ["Steering"]

_ENABLE_AGAIN = 1.0
"""Seconds between repetitions of `enable` while the drone takes off: its subscriber may be late."""


class Steering:
    """Publishers of one drone's velocity, and of its `enable` where it has one."""

    def __init__(self, link: RosLink, settings: Ros2Settings) -> None:
        """Make the publishers on `link`."""
        self._settings = settings
        self._stamped = settings.velocity_type == "twist_stamped"
        self._velocity = link.publisher(
            settings.velocity, TWIST_STAMPED if self._stamped else TWIST
        )
        self._enable = None
        if settings.enable is not None:
            self._enable = link.publisher(settings.enable, BOOL)
        self._enabled_at = -math.inf

    @property
    def listeners(self) -> int:
        """Subscribers of the velocity."""
        return self._velocity.listeners

    def steer(
        self,
        setpoint: VelocitySetpoint,
        odometry: Odometry,
        alignment: Alignment,
        frames: tuple[str, str],
    ) -> None:
        """Publish the velocity of `setpoint`.

        Nothing that is not finite leaves here: zero does.

        Args:
            setpoint: ENU m/s and rad/s.
            odometry: The drone's, in the local frame.
            alignment: Our local frame in the drone's.
            frames: World and body frame of the odometry's messages.
        """
        frame = self._settings.velocity_frame
        velocity = velocity_in(frame, setpoint.velocity, odometry, alignment)
        rate = float(setpoint.yaw_rate)
        if not (is_finite(velocity) and math.isfinite(rate)):
            velocity, rate = np.zeros(3), 0.0
        twist = ros_message(TWIST)
        twist.linear.x, twist.linear.y, twist.linear.z = map(float, velocity)
        twist.angular.z = rate
        if not self._stamped:
            self._velocity.publish(twist)
            return
        world, body = frames
        message = ros_message(TWIST_STAMPED, twist=twist)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(host_time_ns(), NANOSECONDS)
        message.header.frame_id = self._settings.frame_id or (world if frame == "world" else body)
        self._velocity.publish(message)

    def motors_on(self, now: float) -> None:
        """Switch the motors on, once a second at most; `now` is the time in seconds."""
        if self._enable is not None and now - self._enabled_at >= _ENABLE_AGAIN:
            self._enabled_at = now
            self._enable.publish(ros_message(BOOL, data=True))

    def motors_off(self) -> None:
        """Switch the motors off: a flight has ended."""
        self._enabled_at = -math.inf
        if self._enable is not None:
            self._enable.publish(ros_message(BOOL, data=False))
