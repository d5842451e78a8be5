"""Comparison of a drone's motion with its commands.

It finds a drone that is carried off, as by wind that it cannot hold, and one that does not move at
all although it is commanded to, as on the ground with its motors running.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.config.model import LimitsConfig
from aerodaas.geometry.braking import velocity_towards
from aerodaas.geometry.frames import Vector, length
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.mission.motion_requests import Land, MotionRequest, TakeOff

__all__ = ["STANDS_AFTER", "MotionWatch"]

_CARRIED = 0.5
"""m/s along the ground against all commands: more than the noise of a measured velocity."""
_CARRIED_AFTER = 5.0
"""Seconds of that in a row, beside the time that the drone needs to brake."""
_REMEMBERED = 2 * NANOSECONDS
"""Nanoseconds for which a command explains the motion: vehicles lag behind."""
_FASTER = 2.0
"""Times the commanded speed that still follows the command."""
_STANDS_WITHIN = 1.0
"""Metres within which a drone stands: on the ground, running motors shake and shift it."""
_MOVES = 0.3
"""m/s commanded from which it should."""
STANDS_AFTER = 10.0
"""Seconds of standing against the commands after which it counts."""
_STEERED = frozenset({VehicleMode.GUIDED, VehicleMode.HOLDING, VehicleMode.TAKING_OFF})
"""Modes in which it holds its place, or flies as commanded."""


class MotionWatch:
    """Compares one drone's velocity with the commands of the last seconds."""

    def __init__(self, limits: LimitsConfig) -> None:
        """Compare within `limits`, whose acceleration is what the drone brakes by."""
        self.carried_off = 0
        """How often the drone was found carried off, each time after the same patience."""
        self.drift = 0.0
        """m/s along the ground that no command explained, when that was so last."""
        self._limits = limits
        self._setpoint: Setpoint | None = None
        self._commands: deque[tuple[int, float, float]] = deque()
        """Time (ns) and commanded velocity to the east and north (m/s), newest last."""
        self._adrift_since: int | None = None
        self._patience = 0.0
        self._stands_since: int | None = None
        self._lands = False
        self._stood_at: Vector = np.zeros(3)
        self._now = 0

    def command(self, request: MotionRequest, setpoint: Setpoint | None) -> None:
        """Compare the motion with `request` from now on.

        Args:
            request: What the vehicle is asked to do.
            setpoint: The setpoint as which it was sent; None if it was not sent as one.
        """
        if isinstance(request, Land) is not self._lands:
            self._lands, self._stands_since = not self._lands, None
        if self._lands:
            setpoint = VelocitySetpoint(np.array([0.0, 0.0, -self._limits.max_climb]))
        elif isinstance(request, TakeOff):
            setpoint = VelocitySetpoint(np.zeros(3))
        self._setpoint = setpoint

    def observe(self, state: VehicleState, now: int) -> None:
        """Compare the state with the commands.

        Args:
            state: The vehicle's newest state, with a known position.
            now: Mission clock, nanoseconds.
        """
        self._now = now
        if self._setpoint is None:
            self.forget()
            return
        wanted = self._velocity(self._setpoint, state.odometry)
        self._commands.append((now, float(wanted[0]), float(wanted[1])))
        while now - self._commands[0][0] > _REMEMBERED:
            self._commands.popleft()
        if state.mode in _STEERED:
            self._observe_drift(*state.odometry.velocity[:2].tolist())
        else:
            self._adrift_since = None
        position = state.odometry.position
        if length(wanted) < _MOVES:
            self._stands_since = None
        elif self._stands_since is None or length(position - self._stood_at) > _STANDS_WITHIN:
            self._stands_since, self._stood_at = now, position

    def forget(self) -> None:
        """Begin anew: the drone follows no setpoint, or its motion is not known."""
        self._commands.clear()
        self._adrift_since = self._stands_since = None

    @property
    def stands_for(self) -> float:
        """Seconds for which the drone has not moved against its commands; 0 if it moves."""
        return 0.0 if self._stands_since is None else seconds(self._now - self._stands_since)

    def _observe_drift(self, east: float, north: float) -> None:
        # The newest first: nearly always it explains the motion.
        if any(_beside(east, north, x, y) < _CARRIED for _, x, y in reversed(self._commands)):
            self._adrift_since = None
            return
        self.drift = min(_beside(east, north, x, y) for _, x, y in self._commands)
        if self._adrift_since is None:
            self._adrift_since = self._now
            self._patience = _CARRIED_AFTER + self.drift / self._limits.max_acceleration
        if seconds(self._now - self._adrift_since) >= self._patience:
            self.carried_off += 1
            self._adrift_since = None

    def _velocity(self, setpoint: Setpoint, odometry: Odometry) -> Vector:
        if not isinstance(setpoint, PositionSetpoint):
            return setpoint.velocity
        limits = self._limits
        return velocity_towards(
            setpoint,
            odometry.position,
            odometry.yaw,
            speed=limits.cruise_speed,
            deceleration=limits.max_acceleration,
            reaction_time=limits.reaction_time,
            yaw_rate=0.0,
        ).velocity


def _beside(east: float, north: float, x: float, y: float) -> float:
    """How far a velocity is from following the command (x, y) at up to `_FASTER` times its speed.

    It calculates with floats, as the setpoint loop may ask it of each command of the last seconds.
    """
    squared = x * x + y * y
    share = min(max((east * x + north * y) / squared, 0.0), _FASTER) if squared else 0.0
    return math.hypot(east - share * x, north - share * y)
