"""Flight dynamics of a multirotor under its own velocity controller.

The model is a point mass under the thrust of its rotors, gravity and drag, with a first-order lag
from commanded to actual thrust vector in place of the attitude loop (Mellinger and Kumar,
"Minimum snap trajectory generation and control for quadrotors", ICRA 2011, separate the two in
the same way). The controller converts a velocity demand to an acceleration and compensates drag
and wind by feeding back the measured difference between acceleration and thrust (Smeur, de
Croon, Chu, "Cascaded incremental nonlinear dynamic inversion for MAV disturbance rejection",
Control Engineering Practice 73, 2018).

It uses scalar arithmetic, because for vectors of three Python's floats are several times faster
than numpy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from aerodaas.simulation.airframe import GRAVITY, Airframe, Wind

__all__ = [
    "STEP",
    "STEP_NS",
    "KinematicState",
    "Multirotor",
    "Triple",
    "approach_speed",
    "braking_distance",
    "velocity_towards",
    "yaw_rate_towards",
]

Triple: TypeAlias = tuple[float, float, float]

STEP_NS = 10_000_000
"""Fixed time step in nanoseconds; steps lie on the grid of its multiples."""

STEP = STEP_NS / 1e9
_GROUND_STEPS = 9
"""Steps for which a height of the ground is good: a tenth of a second less one."""
"""Fixed time step in seconds."""

_VELOCITY_GAIN = 2.5
"""Velocity gain, 1/s. With the lag below, the velocity loop is overdamped, without overshoot."""

_THRUST_LAG = 0.08
"""Lag from commanded to actual thrust vector in seconds; attitude loops reach 0.05 to 0.15."""

_DISTURBANCE_LAG = 0.25
"""Time constant of the estimate of drag and wind, seconds."""

_YAW_RATE_LAG = 0.12
"""Lag from commanded to actual yaw rate, seconds."""

_MIN_THRUST_SHARE = 0.3
"""Least upward thrust as a fraction of the weight, to stay controllable."""


def _share(lag: float) -> float:
    return 1.0 - math.exp(-STEP / lag)


_THRUST_SHARE = _share(_THRUST_LAG)
_DISTURBANCE_SHARE = _share(_DISTURBANCE_LAG)
_YAW_RATE_SHARE = _share(_YAW_RATE_LAG)


@dataclass(frozen=True, slots=True)
class KinematicState:
    """Exact state of motion at one time; ENU metres, m/s, radians, rad/s."""

    position: Triple
    velocity: Triple
    roll: float
    pitch: float
    yaw: float
    yaw_rate: float


class Multirotor:
    """Vehicle with velocity controller, advanced by steps of `STEP` seconds.

    `max_acceleration` in m/s^2 limits the controller's demand; `max_yaw_rate` is in rad/s, `start`
    in ENU metres, `yaw` in radians. The ground is flat, at the height of `start`, or as high as
    `terrain` says at a place in ENU metres; where that is not known (NaN), as high as before.
    """

    __slots__ = (
        "_body_drag",
        "_disturbance",
        "_max_acceleration",
        "_max_thrust",
        "_max_yaw_rate",
        "_rotor_drag",
        "_steps_to_ground",
        "_terrain",
        "_tilt_slope",
        "_wind",
        "acceleration",
        "ground",
        "impact",
        "on_ground",
        "position",
        "thrust",
        "velocity",
        "yaw",
        "yaw_rate",
    )

    def __init__(
        self,
        airframe: Airframe,
        wind: Wind,
        *,
        max_acceleration: float,
        max_yaw_rate: float,
        start: Triple,
        yaw: float,
        terrain: Callable[[float, float], float] | None = None,
    ) -> None:
        """Start on the ground at `start` with the motors off."""
        self._terrain = terrain
        self._steps_to_ground = 0
        """Steps until the ground is looked up again."""
        self._rotor_drag = airframe.rotor_drag
        self._body_drag = airframe.body_drag
        self._tilt_slope = math.tan(math.radians(airframe.max_tilt))
        self._max_thrust = airframe.thrust_to_weight * GRAVITY
        self._max_acceleration = max_acceleration
        self._max_yaw_rate = max_yaw_rate
        self._wind = wind
        self._disturbance: Triple = (0.0, 0.0, 0.0)
        self.position = start
        self.velocity: Triple = (0.0, 0.0, 0.0)
        self.acceleration: Triple = (0.0, 0.0, 0.0)
        self.thrust: Triple = (0.0, 0.0, 0.0)
        """Thrust over mass, ENU m/s^2."""
        self.yaw = yaw
        self.yaw_rate = 0.0
        self.ground = start[2]
        self.on_ground = True
        self.impact = 0.0
        """Downward speed at the latest touchdown, or the speed into a slope, m/s."""

    @property
    def airspeed(self) -> Triple:
        """Velocity relative to the air, ENU m/s."""
        v, w = self.velocity, self._wind.velocity
        return v[0] - w[0], v[1] - w[1], v[2] - w[2]

    def step(self, demand: Triple | None, yaw_rate: float) -> None:
        """Advance by one step.

        Args:
            demand: Velocity, ENU m/s; None with the motors off.
            yaw_rate: rad/s.
        """
        self._wind.step()
        if demand is None:
            if self.on_ground:
                self._stop()
                return
            command = (0.0, 0.0, 0.0)
        else:
            command = self._command(demand)
        keep = 1.0 - _THRUST_SHARE
        thrust = self.thrust
        self.thrust = fx, fy, fz = (
            keep * thrust[0] + _THRUST_SHARE * command[0],
            keep * thrust[1] + _THRUST_SHARE * command[1],
            keep * thrust[2] + _THRUST_SHARE * command[2],
        )
        ux, uy, uz = self.airspeed
        drag = self._rotor_drag + self._body_drag * math.sqrt(ux * ux + uy * uy + uz * uz)
        dx, dy, dz = -drag * ux, -drag * uy, -drag * uz
        lx, ly, lz = self._disturbance
        self._disturbance = (
            lx + _DISTURBANCE_SHARE * (dx - lx),
            ly + _DISTURBANCE_SHARE * (dy - ly),
            lz + _DISTURBANCE_SHARE * (dz - lz),
        )
        self._move((fx + dx, fy + dy, fz - GRAVITY + dz), yaw_rate)

    def rest(self) -> None:
        """Stand where it is."""
        self.on_ground = True
        self._stop()

    def _stop(self) -> None:
        self.velocity = self.acceleration = self.thrust = (0.0, 0.0, 0.0)
        self._disturbance = (0.0, 0.0, 0.0)
        self.yaw_rate = 0.0

    def _command(self, demand: Triple) -> Triple:
        """Commanded thrust over mass, within tilt and acceleration limits."""
        vx, vy, vz = self.velocity
        ax = _VELOCITY_GAIN * (demand[0] - vx)
        ay = _VELOCITY_GAIN * (demand[1] - vy)
        az = upward = _VELOCITY_GAIN * (demand[2] - vz)
        if ax * ax + ay * ay + az * az > self._max_acceleration * self._max_acceleration:
            ax, ay, az = _limited((ax, ay, az), demand, self._max_acceleration)
        lx, ly, lz = self._disturbance
        fx, fy, fz = ax - lx, ay - ly, az - lz + GRAVITY
        fz = min(max(fz, _MIN_THRUST_SHARE * GRAVITY), self._max_thrust)
        sideways = math.hypot(fx, fy)
        if sideways > self._tilt_slope * fz:
            # At its largest tilt the height goes first, as in PX4 and ArduPilot.
            upward = min(max(upward, -self._max_acceleration), self._max_acceleration)
            least = _MIN_THRUST_SHARE * GRAVITY
            fz = min(max(upward - lz + GRAVITY, least), self._max_thrust)
            scale = min(1.0, self._tilt_slope * fz / sideways)
            fx, fy = fx * scale, fy * scale
        return fx, fy, fz

    def _move(self, acceleration: Triple, yaw_rate: float) -> None:
        ax, ay, az = acceleration
        if self.on_ground:
            if az <= 0.0:
                self.velocity = self.acceleration = (0.0, 0.0, 0.0)
                self.yaw_rate = 0.0
                return
            self.on_ground = False
        x, y, z = self.position
        vx, vy, vz = self.velocity
        half = 0.5 * STEP * STEP
        z += vz * STEP + az * half
        self.position = (x + vx * STEP + ax * half, y + vy * STEP + ay * half, z)
        self.velocity = (vx + ax * STEP, vy + ay * STEP, vz + az * STEP)
        self.acceleration = acceleration
        wanted = min(max(yaw_rate, -self._max_yaw_rate), self._max_yaw_rate)
        self.yaw_rate += _YAW_RATE_SHARE * (wanted - self.yaw_rate)
        self.yaw = math.remainder(self.yaw + self.yaw_rate * STEP, math.tau)
        slope = self._terrain is not None and self._look_below(self._terrain)
        if z <= self.ground and (self.velocity[2] < 0.0 or slope):
            self.impact = math.hypot(*self.velocity) if slope else -self.velocity[2]
            self.position = (self.position[0], self.position[1], self.ground)
            self.velocity = self.acceleration = (0.0, 0.0, 0.0)
            self.yaw_rate = 0.0
            self.on_ground = True

    def _look_below(self, terrain: Callable[[float, float], float]) -> bool:
        """Take the ground's height from `terrain`; returns whether the drone is in a slope."""
        self._steps_to_ground -= 1
        if self._steps_to_ground < 0:
            self._steps_to_ground = _GROUND_STEPS
            height = terrain(self.position[0], self.position[1])
            self.ground = self.ground if math.isnan(height) else height
        return self.position[2] < self.ground

    def motion(self, ahead: float = 0.0) -> KinematicState:
        """State of motion, extrapolated by `ahead` seconds (less than a step).

        The extrapolation does not change the simulation.
        """
        x, y, z = self.position
        vx, vy, vz = self.velocity
        ax, ay, az = self.acceleration
        half = 0.5 * ahead * ahead
        roll, pitch = self._tilt()
        return KinematicState(
            (
                x + vx * ahead + ax * half,
                y + vy * ahead + ay * half,
                max(self.ground, z + vz * ahead + az * half),
            ),
            (vx + ax * ahead, vy + ay * ahead, vz + az * ahead),
            roll,
            pitch,
            math.remainder(self.yaw + self.yaw_rate * ahead, math.tau),
            self.yaw_rate,
        )

    def _tilt(self) -> tuple[float, float]:
        """Roll and pitch that align the body's up axis with the thrust."""
        fx, fy, fz = self.thrust
        size = math.sqrt(fx * fx + fy * fy + fz * fz)
        if self.on_ground or size < _MIN_THRUST_SHARE:
            return 0.0, 0.0
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        forward, left = c * fx + s * fy, c * fy - s * fx
        return math.asin(-left / size), math.atan2(forward, fz)


def _limited(wanted: Triple, demand: Triple, most: float) -> Triple:
    """An acceleration of at most `most` m/s²: what is flown beside the demanded way stops first.

    What is left speeds up or brakes along it. At a corner, where both are wanted, a drone that did
    neither in full would be carried past.
    """
    ax, ay, az = wanted
    speed = math.hypot(*demand)
    ux, uy, uz = (part / speed for part in demand) if speed > 0.0 else (0.0, 0.0, 0.0)
    along = ax * ux + ay * uy + az * uz
    bx, by, bz = ax - along * ux, ay - along * uy, az - along * uz
    aside = math.sqrt(bx * bx + by * by + bz * bz)
    share = min(1.0, most / aside) if aside > 0.0 else 1.0
    rest = math.sqrt(max(0.0, most * most - (share * aside) ** 2))
    along = min(max(along, -rest), rest)
    return share * bx + along * ux, share * by + along * uy, share * bz + along * uz


_POSITION_GAIN = 1.2
"""Proportional gain close to the target, 1/s."""

_BRAKING_SHARE = 0.5
"""Fraction of the acceleration limit used to plan braking; the rest is reserve for lag and wind."""

_YAW_GAIN = 1.8
"""Proportional gain of the yaw, 1/s."""


def approach_speed(distance: float, max_acceleration: float) -> float:
    """Highest speed from which the vehicle can stop within `distance`, m/s.

    Proportional close to the target, a square root farther away, joined smoothly: ArduPilot's
    `sqrt_controller`.

    Args:
        distance: Metres.
        max_acceleration: Of the vehicle, m/s².
    """
    braking = _BRAKING_SHARE * max_acceleration
    linear = braking / _POSITION_GAIN**2
    if distance <= linear:
        return _POSITION_GAIN * distance
    return math.sqrt(2.0 * braking * (distance - 0.5 * linear))


def braking_distance(speed: float, max_acceleration: float) -> float:
    """Distance within which the vehicle stops, metres; the inverse of `approach_speed`.

    Args:
        speed: m/s.
        max_acceleration: Of the vehicle, m/s².
    """
    braking = _BRAKING_SHARE * max_acceleration
    linear = braking / _POSITION_GAIN**2
    if speed <= _POSITION_GAIN * linear:
        return speed / _POSITION_GAIN
    return speed * speed / (2.0 * braking) + 0.5 * linear


def velocity_towards(
    position: Triple,
    target: Triple,
    *,
    speed: float,
    climb: float,
    max_acceleration: float,
    passing_speed: float = 0.0,
) -> Triple:
    """Velocity that leads from `position` straight to `target`, ENU m/s.

    Args:
        position: Where the vehicle is, ENU metres.
        target: Where it stops, or what it passes, ENU metres.
        speed: Bound of the horizontal speed, m/s.
        climb: Bound of the vertical speed, m/s.
        max_acceleration: Of the vehicle, m/s².
        passing_speed: Speed at which the target is passed, m/s; 0 stops there.
    """
    x, y, z = target[0] - position[0], target[1] - position[1], target[2] - position[2]
    across = math.hypot(x, y)
    distance = math.hypot(across, z)
    if distance <= 0.0:
        return 0.0, 0.0, 0.0
    room = distance + braking_distance(passing_speed, max_acceleration)
    rate = approach_speed(room, max_acceleration) / distance
    if across * rate > speed:
        rate = speed / across
    if abs(z) * rate > climb:
        rate = climb / abs(z)
    return x * rate, y * rate, z * rate


def yaw_rate_towards(yaw: float, target: float) -> float:
    """Yaw rate that turns from `yaw` to `target` by the smaller angle, rad/s.

    Args:
        yaw: Radians.
        target: Radians.
    """
    return _YAW_GAIN * math.remainder(target - yaw, math.tau)
