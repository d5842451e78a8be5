"""Dead reckoning of a Tello's position from velocities reported in steps of 0.1 m/s.

Each quantity is predicted by a model of the Tello's response to its sticks, and each packet then
clips it to the range that its rounded value allows: an observer with a set-valued measurement. So
slow motion, which the packets alone report as standing still, is not lost, while no error of the
model can grow beyond one step of the values.
"""

from __future__ import annotations

import math

import numpy as np

from aerodaas.extensions.tello.commands import BodyMotion
from aerodaas.extensions.tello.state import TelloState
from aerodaas.geometry.frames import Vector, body_to_enu, wrap_angle
from aerodaas.messages.odometry import Odometry

__all__ = ["DeadReckoning"]

_VELOCITY_STEP = 0.1
"""Step of the reported speed in m/s. Rounding is not documented, so a full step is allowed."""
_HEIGHT_STEP = 0.1
"""Metres; likewise."""
_YAW_STEP = math.radians(1.0)

_VELOCITY_LAG = 0.35
"""Time constant in seconds of the response to a velocity (assumed; packets correct it)."""
_YAW_LAG = 0.2
"""The same for its yaw rate."""

_WALK = 2.0 * (_VELOCITY_STEP / math.sqrt(12.0)) ** 2
"""m^2 of variance gained per second: the rounding error of a velocity, uniform over a step, that
stays the same for about a second."""
_SCALE_ERROR = 0.05
"""Error as a share of the distance flown, by optical flow's error in height (assumed)."""
_BLIND = 0.5
"""m/s by which the uncertainty grows without packets."""
_PACKET_PERIOD = 0.1
_LATE = 3
"""Packets missed in a row after which the estimate is blind."""


class DeadReckoning:
    """Position and velocity of one Tello in ENU.

    Times are in seconds of any monotonic clock. Position and heading at the first packet are those
    of the environment file.
    """

    def __init__(self, start: Vector, yaw: float) -> None:
        """Start at `start` (ENU metres) with this `yaw` (radians, counter-clockwise from east)."""
        self._ground = float(start[2])
        self._start_yaw = yaw
        self._offset: float | None = None
        """ENU yaw of the Tello's ground frame, from the first packet on."""
        self._take_off_height = self._ground
        self._position: Vector = start.astype(np.float64)
        self._velocity: Vector = np.zeros(3)
        self._yaw = yaw
        self._yaw_rate = 0.0
        self._roll = self._pitch = 0.0
        self._walked = 0.0
        self._way = 0.0
        self._blind_for = 0.0
        self.time: float = -math.inf
        """Time of the estimate."""
        self._packet_at = -math.inf
        self._standing = True

    @property
    def odometry(self) -> Odometry:
        """The newest estimate; `position_sigma` is its standard deviation."""
        return Odometry(
            self._position.copy(),
            self._velocity.copy(),
            wrap_angle(self._yaw),
            self._roll,
            self._pitch,
            self._yaw_rate,
            self.sigma,
        )

    @property
    def sigma(self) -> float:
        """Standard deviation of the horizontal position, metres."""
        return math.sqrt(
            self._walked + (_SCALE_ERROR * self._way) ** 2 + (_BLIND * self._blind_for) ** 2
        )

    def predict(self, now: float, asked: BodyMotion) -> None:
        """Predict the estimate at `now`.

        Args:
            now: Monotonic clock, seconds.
            asked: The sticks since the last call.
        """
        elapsed = now - self.time
        self.time = now
        if self._standing or not 0.0 < elapsed < math.inf:
            return
        before = self._velocity
        target = body_to_enu(asked.velocity, self._yaw)
        self._velocity = target + (before - target) * math.exp(-elapsed / _VELOCITY_LAG)
        step = 0.5 * (before + self._velocity) * elapsed
        self._position += step
        self._yaw_rate = asked.yaw_rate + (self._yaw_rate - asked.yaw_rate) * math.exp(
            -elapsed / _YAW_LAG
        )
        self._yaw += self._yaw_rate * elapsed
        self._way += math.hypot(step[0], step[1])
        self._walked += _WALK * elapsed
        if now - self._packet_at > _LATE * _PACKET_PERIOD:
            self._blind_for += elapsed

    def correct(self, state: TelloState, now: float, *, standing: bool) -> None:
        """Limit the estimate to the range that a new packet allows.

        Args:
            state: The packet.
            now: Time of the estimate, seconds.
            standing: Whether the drone is on the ground; nothing moves then, and heights count from
                there.
        """
        self._packet_at = now
        self._standing = standing
        if self._offset is None:
            self._offset = self._start_yaw + state.yaw
        yaw = self._offset - state.yaw
        self._yaw = yaw + _cut(wrap_angle(self._yaw - yaw), _YAW_STEP)
        self._roll, self._pitch = state.roll, state.pitch
        if standing:
            self._velocity = np.zeros(3)
            self._yaw_rate = 0.0
            self._position[2] = self._ground
            self._take_off_height = self._ground - state.height
            return
        ahead, right, down = state.velocity
        measured = body_to_enu(np.array([ahead, -right, -down]), self._offset)
        off = self._velocity - measured
        self._velocity = measured + np.clip(off, -_VELOCITY_STEP, _VELOCITY_STEP)
        height = self._take_off_height + state.height
        self._position[2] = height + _cut(float(self._position[2]) - height, _HEIGHT_STEP)


def _cut(value: float, most: float) -> float:
    return min(max(value, -most), most)
