"""Guidance to a position: a target that moves there at the commanded speed.

Neither autopilot accepts a speed with a position: PX4 would fly at its own. So the target itself
moves, a moment's flight ahead of the vehicle, and a velocity is sent along. If the setpoints end,
the vehicle stops at the target, which is near, instead of flying on to the position.

An autopilot adds the velocity setpoint to its own position control. The setpoint leaves room for
that, so that both together are the commanded speed, reduced in time before the position: a vehicle
that lands there must not be fast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerodaas.types.braking import braking_speed
from aerodaas.types.geometry import Vector, wrap_angle

__all__ = ["MovingTarget", "Target"]

_PULL = 1.0
"""1/s: the speed that either autopilot adds for each metre that it is behind its target (PX4's
MPC_XY_P is 0.95, ArduCopter's PSC_POSXY_P is 1.0)."""
_REACTION = 1.2
"""Seconds from a target's velocity to the vehicle's: PX4's simulated quadrotor takes 0.5 to 1,
and what it says of itself is a little old."""
_BRAKING = 1.5
"""Assumed braking of a vehicle in m/s², half of its capability."""
_LEASH = 1.0
"""Lead of the target in seconds of flight, plus a metre."""
_LONGEST = 0.2
"""Longest step in seconds: a loop that was delayed does not catch up."""


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """State of the moving target: ENU metres, ENU m/s, radians."""

    position: Vector
    velocity: Vector
    yaw: float


class MovingTarget:
    """Moving target of one vehicle, limited to `acceleration` (m/s²) and `yaw_rate` (rad/s)."""

    def __init__(self, acceleration: float, yaw_rate: float) -> None:
        self._acceleration = acceleration
        self._braking = min(acceleration, _BRAKING)
        self._yaw_rate = yaw_rate
        self._position: Vector | None = None
        self._velocity: Vector = np.zeros(3)
        self._yaw = 0.0
        self._now = 0.0

    def forget(self) -> None:
        """Restart from the vehicle's position at the next call."""
        self._position = None

    def towards(
        self,
        place: Vector,
        yaw: float | None,
        speed: float,
        *,
        vehicle: Vector,
        velocity: Vector,
        facing: float,
        now: float,
        waits: bool = False,
    ) -> Target:
        """The target at `now` (seconds), moving to `place` at `speed` (m/s).

        `vehicle`, `velocity` and `facing` are the vehicle's own state; while it `waits` for its
        mode the target stays with it.
        """
        duration = min(_LONGEST, max(0.0, now - self._now))
        self._now = now
        if self._position is None or waits:
            self._position, self._velocity = vehicle, np.zeros(3) if waits else velocity
            self._yaw = facing
            if waits:
                return Target(vehicle, np.zeros(3), facing)
        way = place - self._position
        left = float(np.linalg.norm(way))
        direction = way / left if left > 0.0 else np.zeros(3)
        lead = self._position - vehicle
        to_go = float((place - vehicle) @ direction)
        fastest = min(speed, braking_speed(to_go, self._braking, _REACTION))
        drawn = _PULL * float(lead @ direction)
        pace = max(0.0, float(self._velocity @ direction)) + self._acceleration * duration
        pace = min(speed, pace, braking_speed(left, self._acceleration, 0.0))
        if drawn > fastest or float(np.linalg.norm(lead)) > 1.0 + _LEASH * speed:
            pace = 0.0
        step = min(left, pace * duration)
        self._position = self._position + step * direction
        self._velocity = pace * direction
        sent = min(pace, max(0.0, fastest - drawn)) * direction
        if yaw is not None:
            most = self._yaw_rate * duration
            turn = wrap_angle(yaw - self._yaw)
            self._yaw = wrap_angle(self._yaw + math.copysign(min(abs(turn), most), turn))
        return Target(self._position, sent, self._yaw)
