"""Guidance to a position: a target that moves there at the commanded speed.

Neither autopilot accepts a speed with a position: PX4 would fly at its own. So the target itself
moves, a moment's flight ahead of the vehicle, and a velocity is sent along. If the setpoints end,
the vehicle stops at the target, which is near, instead of flying on to the position.

At a place that is to be passed the target waits for the vehicle, to which the velocity is sent on
at which it passes.

An autopilot adds the velocity setpoint to its own position control. The setpoint leaves room for
that, so that both together are the commanded speed, reduced in time before the position: a vehicle
that lands there must not be fast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerodaas.geometry.braking import braking_distance, braking_speed
from aerodaas.geometry.frames import Vector, wrap_angle
from aerodaas.messages.vehicle import PositionSetpoint

__all__ = ["MovingTarget", "Target"]

_PULL = 1.0
"""1/s: the speed that either autopilot adds for each metre that it is behind its target (PX4's
MPC_XY_P is 0.95, ArduCopter's PSC_POSXY_P is 1.0)."""
_REACTION = 1.3
"""Seconds from a target's velocity to the vehicle's: PX4's simulated quadrotor takes 0.5 to 1,
and what it says of itself is a little old."""
_BRAKING = 1.5
"""Assumed braking of a vehicle in m/s², half of its capability."""
_LEAD = 1.5
"""Metres that the target is ahead at most. Farther away ArduCopter draws by a square root instead
of `_PULL` (AC_AttitudeControl's sqrt_controller), and the vehicle would be slower than asked."""
_DELAY = 0.1
"""Seconds by which the vehicle has flown on since its position was measured, and until the target
is heard."""
_TOLERANCE = 0.02
"""Share of the speed by which a vehicle that has fallen behind may catch up."""
_REACH = 2.0
"""m/s faster than the vehicle flies that it is told to fly. One that is as fast as it can be, as
against the wind, leans for its speed alone where more is asked of it, and is blown off its line."""
_EXCESS = 0.5
"""Share of what a vehicle is too fast by, before a place or aside from its line, that it is told
to be slower by. An autopilot learns what it has to lean against the air and unlearns it late: PX4's
simulated quadrotor (SIH), whose drag is 1 m/s² for each m/s, braked at half of what it was told and
overshot corners by 2 m."""
_ASIDE = 0.3
"""m/s aside from the line that are no excess."""
_CATCH_UP = 2.0
"""1/s: how quickly the target takes up its full lead."""
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
        setpoint: PositionSetpoint,
        speed: float,
        *,
        vehicle: Vector,
        velocity: Vector,
        facing: float,
        now: float,
        waits: bool = False,
    ) -> Target:
        """The target at `now`, moving to the place of `setpoint`.

        Args:
            setpoint: Where the vehicle is to fly.
            speed: Speed on the way, m/s.
            vehicle: Where the vehicle is, ENU metres.
            velocity: The vehicle's velocity, ENU m/s.
            facing: The vehicle's yaw, radians.
            now: Monotonic clock, seconds.
            waits: Whether the vehicle waits for its mode; the target stays with it then.
        """
        duration = min(_LONGEST, max(0.0, now - self._now))
        self._now = now
        if self._position is None or waits:
            self._position, self._velocity = vehicle, np.zeros(3) if waits else velocity
            self._yaw = facing
            if waits:
                return Target(vehicle, np.zeros(3), facing)
        place, passing = setpoint.position, setpoint.passing_speed
        if setpoint.line_from is not None:
            self._come_onto_line(setpoint.line_from, place, speed * duration)
        way = place - self._position
        left = float(np.linalg.norm(way))
        direction = _unit(way if left > 0.0 or passing == 0.0 else place - vehicle)
        lead = self._position - vehicle
        along = float(lead @ direction)
        moving = float(velocity @ direction)
        to_go = float((place - vehicle) @ direction)
        beyond = braking_distance(passing, self._braking, _REACTION)
        fastest = min(speed, braking_speed(to_go + beyond, self._braking, _REACTION))
        beyond = braking_distance(passing, self._acceleration, 0.0)
        ramp = max(0.0, float(self._velocity @ direction)) + self._acceleration * duration
        ramp = min(speed, ramp, braking_speed(left + beyond, self._acceleration, 0.0))
        ramp = min(ramp, max(0.0, moving) + _REACH)
        if float(np.linalg.norm(lead)) > 1.0 + speed:
            ramp = 0.0
        # The lead settles: a target that stood and waited for the vehicle would have it fly in
        # bursts.
        room = min(0.5 * fastest / _PULL, _LEAD) - along
        pace = min(ramp, max(0.0, moving + _CATCH_UP * room))
        step = min(left, pace * duration)
        self._position = self._position + step * direction
        self._velocity = ramp * direction
        drawn = _PULL * along
        if fastest == speed:
            drawn -= _PULL * _DELAY * moving + _TOLERANCE * speed
        else:
            drawn += _EXCESS * max(0.0, moving - fastest)
        sent = min(ramp, max(0.0, fastest - drawn)) * direction
        if setpoint.line_from is not None:
            sent = sent - _excess_aside(vehicle, velocity, setpoint.line_from, place)
        if setpoint.yaw is not None:
            most = self._yaw_rate * duration
            turn = wrap_angle(setpoint.yaw - self._yaw)
            self._yaw = wrap_angle(self._yaw + math.copysign(min(abs(turn), most), turn))
        return Target(self._position, sent, self._yaw)

    def _come_onto_line(self, start: Vector, end: Vector, step: float) -> None:
        """Move the target aside by at most `step` metres, onto the line from `start` to `end`."""
        assert self._position is not None  # noqa: S101 - `towards` has set it
        line = end - start
        long = float(np.linalg.norm(line))
        direction = _unit(line)
        along = min(max(0.0, float((self._position - start) @ direction)), long)
        aside = start + along * direction - self._position
        far = float(np.linalg.norm(aside))
        self._position = self._position + _unit(aside) * min(far, step)


def _excess_aside(vehicle: Vector, velocity: Vector, start: Vector, end: Vector) -> Vector:
    """Velocity back to the line for a vehicle that flies aside from the line to `end`, ENU m/s.

    What draws it to the line is no excess.
    """
    direction = _unit(end - start)
    offset, aside = _across(vehicle - start, direction), _across(velocity, direction)
    way = _unit(aside)
    allowed = _ASIDE + _PULL * max(0.0, -float(offset @ way))
    return _EXCESS * max(0.0, float(np.linalg.norm(aside)) - allowed) * way


def _across(vector: Vector, direction: Vector) -> Vector:
    """The part of `vector` across a unit vector."""
    return vector - float(vector @ direction) * direction


def _unit(way: Vector) -> Vector:
    long = float(np.linalg.norm(way))
    return way / long if long > 0.0 else np.zeros(3)
