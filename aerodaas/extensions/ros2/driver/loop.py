"""Take-off, hold and landing by velocities alone, for a drone that takes nothing else.

It decides; publishing and threads are the vehicle's.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from aerodaas.drivers.setpoints import slowed
from aerodaas.geometry.braking import limit_length, stopping_point, velocity_towards
from aerodaas.geometry.frames import Vector, length, wrap_angle
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import FlightEnd, PositionSetpoint, VehicleMode, VelocitySetpoint

__all__ = ["STANDS_STILL", "Limits", "Touchdown", "VelocityLoop"]

_NEAR = 0.3
"""Metres from the height of the take-off within which ground is expected."""
_STILL_NEAR, _STILL_ELSEWHERE = 1.0, 5.0
"""Seconds of standing still, although a descent is commanded, that make a landing there."""
_STILL = 0.05
"""Metres of height within which it stands still."""
_OBEYED = 0.2
"""Metres that it must have come down by, so that standing still tells of a ground and not of a
drone that does not listen."""
_FEWEST = 5
"""Readings that it takes to call something still."""
_FALL = 2.0
"""m/s downwards that is no landing."""


class Touchdown:
    """Follows one landing by the heights of fresh odometry, while a descent is commanded.

    Velocities are not used to call it still: some publishers leave them zero.
    """

    def __init__(self, ground: float) -> None:
        """Expect the ground at the height `ground`, metres."""
        self._ground = ground
        self._heights: deque[tuple[float, float]] = deque()
        self._highest = -math.inf
        self._fastest = 0.0

    def observe(self, odometry: Odometry, now: float) -> None:
        """Take fresh odometry, heard at `now` (seconds).

        Args:
            odometry: The drone's, in the local frame.
            now: Monotonic clock, seconds.
        """
        height = float(odometry.position[2])
        self._highest = max(self._highest, height)
        self._fastest = max(self._fastest, -float(odometry.velocity[2]))
        self._heights.append((now, height))
        while now - self._heights[0][0] > _STILL_ELSEWHERE + 1.0:
            self._heights.popleft()

    def end(self, now: float) -> FlightEnd | None:
        """How the landing ended, at `now` (seconds); None while it goes on."""
        if not self._heights:
            return None
        newest = self._heights[-1][1]
        near = newest < self._ground + _NEAR
        if not near and self._highest - newest < _OBEYED:
            return None
        seconds = _STILL_NEAR if near else _STILL_ELSEWHERE
        if now - self._heights[0][0] < seconds:
            return None
        recent = [height for at, height in self._heights if now - at <= seconds]
        if len(recent) < _FEWEST or max(recent) - min(recent) > _STILL:
            return None
        return FlightEnd.FELL if self._fastest > _FALL else FlightEnd.LANDED


_SILENT = 0.5
"""Seconds without a setpoint after which it stops and holds."""
_CLIMBED = 0.15
"""Tolerance of the take-off's height, metres."""
_LIFTED = 0.3
"""Metres from which it counts as flying."""
_AT_REST = 0.05
"""Metres from its target within which it is left alone."""
_FACING = math.radians(2.0)
_REACTION = 0.3
"""Seconds from a velocity to its effect (assumed)."""
_BRAKING = 1.0
"""m/s^2 assumed when flying to a position."""
_SLOWEST_CLIMB = 0.15
"""m/s."""

STANDS_STILL = VelocitySetpoint(np.zeros(3))


@dataclass(frozen=True)
class Limits:
    """Speeds that a drone is told at most."""

    cruise: float
    """m/s towards a position that names no speed."""
    speed: float
    """m/s horizontally."""
    climb: float
    """m/s vertically."""
    landing: float
    """m/s of a landing's descent."""
    turn: float
    """rad/s."""


class VelocityLoop:
    """Flight phase of one drone and the velocity that it wants, in home's ENU.

    Times are seconds of any monotonic clock.
    """

    def __init__(self, limits: Limits, ground: float) -> None:
        """Start on the ground, whose height is `ground` metres."""
        self._limits = limits
        self._ground = ground
        self.mode = VehicleMode.GROUNDED
        self.ended: FlightEnd | None = None
        """End of the latest flight; None before and during one."""
        self._lifted = False
        self._target: PositionSetpoint | None = None
        self._told_at = -math.inf
        self._touchdown = Touchdown(ground)

    @property
    def airborne(self) -> bool:
        """Whether its motors may turn."""
        return self.mode is not VehicleMode.GROUNDED

    def begin(self, odometry: Odometry) -> None:
        """Start from where it is: one that is found in the air is held there."""
        if odometry.height > self._ground + 2 * _LIFTED:
            self._lifted = True
            self.hold(odometry)

    def take_off(self, height: float, odometry: Odometry) -> None:
        """Climb from where it stands.

        Args:
            height: Metres.
            odometry: The drone's, in the local frame.
        """
        self._ground = odometry.height
        self._touchdown = Touchdown(self._ground)
        self._target = PositionSetpoint(
            odometry.position + np.array([0.0, 0.0, height]), odometry.yaw, self._limits.climb
        )
        self.mode, self.ended, self._lifted = VehicleMode.TAKING_OFF, None, False

    def hold(self, odometry: Odometry) -> None:
        """Brake and stay."""
        place = stopping_point(odometry.position, odometry.velocity, _BRAKING)
        self._target = PositionSetpoint(place, odometry.yaw)
        self.mode = VehicleMode.HOLDING

    def land(self, odometry: Odometry | None) -> None:
        """Come down where it is, or wherever it drifts to where that is not known."""
        self._target = None if odometry is None else PositionSetpoint(odometry.position)
        self._touchdown = Touchdown(self._ground)
        self.mode = VehicleMode.LANDING

    def guide(
        self, setpoint: PositionSetpoint | VelocitySetpoint, odometry: Odometry, now: float
    ) -> tuple[PositionSetpoint | VelocitySetpoint, VelocitySetpoint]:
        """Follow a setpoint.

        Args:
            setpoint: The setpoint to follow.
            odometry: The drone's, in the local frame.
            now: Monotonic clock, seconds.

        Returns:
            The setpoint as it was clipped, and the velocity that it means now.
        """
        self.mode, self._told_at = VehicleMode.GUIDED, now
        if isinstance(setpoint, VelocitySetpoint):
            rate = _cut(float(setpoint.yaw_rate), self._limits.turn)
            clipped = VelocitySetpoint(self._clip(setpoint.velocity), rate)
            return clipped, clipped
        setpoint, _ = slowed(setpoint, self._limits.cruise, self._limits.speed)
        return setpoint, self._towards(setpoint, odometry)

    def observe(self, odometry: Odometry, now: float) -> None:
        """Take fresh odometry.

        Args:
            odometry: The drone's, in the local frame.
            now: Monotonic clock, seconds.
        """
        self._lifted = self._lifted or odometry.height > self._ground + _LIFTED
        if self.mode is VehicleMode.LANDING:
            self._touchdown.observe(odometry, now)

    def step(self, odometry: Odometry | None, now: float) -> VelocitySetpoint | None:
        """The velocity to be told now; None where the drone is told nothing.

        While setpoints come, their sender tells the velocity.

        Args:
            odometry: The drone's, in the local frame; None while it is too old to fly by.
            now: Monotonic clock, seconds.
        """
        if self.mode is VehicleMode.GROUNDED:
            return None
        if self.mode is VehicleMode.LANDING:
            return self._come_down(odometry, now)
        if odometry is None:
            return STANDS_STILL
        if self.mode is VehicleMode.GUIDED:
            if now - self._told_at <= _SILENT:
                return None
            self.hold(odometry)
        target = self._target
        assert target is not None  # noqa: S101 - each mode left here has one
        if self.mode is VehicleMode.TAKING_OFF:
            up = float(target.position[2]) - odometry.height
            if abs(up) <= _CLIMBED:
                self.mode = VehicleMode.HOLDING
                self._target = PositionSetpoint(target.position, target.yaw)
            else:
                return self._climb(target, odometry, up)
        return self._towards(target, odometry)

    def _climb(self, target: PositionSetpoint, odometry: Odometry, up: float) -> VelocitySetpoint:
        level = PositionSetpoint(np.array([*target.position[:2], odometry.height]), target.yaw)
        asked = self._towards(level, odometry)
        climb = math.copysign(min(self._limits.climb, max(_SLOWEST_CLIMB, abs(up))), up)
        return VelocitySetpoint(np.array([*asked.velocity[:2], climb]), asked.yaw_rate)

    def _come_down(self, odometry: Odometry | None, now: float) -> VelocitySetpoint | None:
        down = np.array([0.0, 0.0, -self._limits.landing])
        if odometry is None:
            return VelocitySetpoint(down)
        end = self._touchdown.end(now)
        if end is not None:
            self.mode = VehicleMode.GROUNDED
            self.ended = end if self._lifted else None
            return STANDS_STILL
        if self._target is None:
            self._target = PositionSetpoint(odometry.position)
        here = PositionSetpoint(np.array([*self._target.position[:2], odometry.height]))
        return VelocitySetpoint(self._towards(here, odometry).velocity + down)

    def _towards(self, target: PositionSetpoint, odometry: Odometry) -> VelocitySetpoint:
        asked = velocity_towards(
            target,
            odometry.position,
            odometry.yaw,
            speed=self._limits.cruise,
            deceleration=_BRAKING,
            reaction_time=_REACTION,
            yaw_rate=self._limits.turn,
        )
        stops = target.passing_speed == 0.0
        near = stops and length(target.position - odometry.position) < _AT_REST
        faces = target.yaw is None or abs(wrap_angle(target.yaw - odometry.yaw)) < _FACING
        return VelocitySetpoint(
            np.zeros(3) if near else self._clip(asked.velocity), 0.0 if faces else asked.yaw_rate
        )

    def _clip(self, velocity: Vector) -> Vector:
        across = limit_length(velocity[:2], self._limits.speed)
        return np.array([across[0], across[1], _cut(float(velocity[2]), self._limits.climb)])


def _cut(value: float, most: float) -> float:
    return min(max(value, -most), most)
