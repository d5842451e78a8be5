"""Autopilot of the simulated drone: mode logic from takeoff to landing."""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerodaas.messages.vehicle import FlightEnd, VehicleMode
from aerodaas.simulation.airframe import Airframe
from aerodaas.simulation.battery import FlightBattery, flight_power
from aerodaas.simulation.contact import Collision, Contacts
from aerodaas.simulation.dynamics import (
    STEP,
    Multirotor,
    Triple,
    velocity_towards,
    yaw_rate_towards,
)
from aerodaas.simulation.sensors import SensorNoise

__all__ = ["Autopilot", "FlightLimits", "Goto", "Steer"]

_SPOOL_UP = 0.8
"""Seconds from arming until the rotors lift."""

_DISARM_AFTER = 0.5
"""Seconds on the ground after a landing until the motors stop."""

_DISARM_GUIDED_AFTER = 2.0
"""The same after setpoints led to the ground, as PX4's COM_DISARM_LAND."""

_POWER_PERIOD = 10
"""Steps between two computations of the power drawn, which changes slowly."""

_ARRIVED = 0.1
"""Tolerance in metres and m/s within which a takeoff height or home counts as reached."""

_STANDING = 0.15
"""Speed in m/s below which a hold latches its position."""

_FLARE_SPEED_PER_METRE = 0.5
"""Descent speed per metre of height above the ground, 1/s."""

_CRASH_SPEED = 2.0
"""Downward speed in m/s at touchdown above which it is a collision with the ground."""


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Limits of the vehicle's motion, m/s and m/s^2."""

    speed: float
    climb: float
    acceleration: float
    cruise: float
    """Default horizontal speed, m/s."""


@dataclass(frozen=True, slots=True)
class Goto:
    """Setpoint: an estimated position (ENU metres), speed limit (m/s) and yaw (radians)."""

    position: Triple
    yaw: float
    speed: float
    passing_speed: float = 0.0
    """m/s at which the position is passed; 0 stops there."""


@dataclass(frozen=True, slots=True)
class Steer:
    """Setpoint: a velocity (ENU m/s) and a yaw rate (rad/s)."""

    velocity: Triple
    yaw_rate: float


class Autopilot:
    """Flies a `Multirotor` by its estimated position, one step at a time.

    The public methods set a mode and a target, which the caller must have validated.
    """

    def __init__(
        self,
        airframe: Airframe,
        rotor: Multirotor,
        noise: SensorNoise,
        limits: FlightLimits,
        contacts: Contacts | None = None,
    ) -> None:
        """Start on the ground, disarmed; `contacts` with the world, None for an empty one."""
        self.mode = VehicleMode.GROUNDED
        self.armed = False
        self.collision: Collision | None = None
        """The first one; from then on its motors stand still."""
        self.ended: FlightEnd | None = None
        """End of the latest flight; None before and during one."""
        self.battery = FlightBattery(airframe)
        self._airframe = airframe
        self._rotor = rotor
        self._noise = noise
        self._limits = limits
        self._contacts = contacts
        self._home = rotor.position
        self._target: Goto | Steer | None = None
        self._steps = 0
        self._spooling = 0.0
        self._grounded_for = 0.0
        self._lifted = False

    @property
    def flying(self) -> bool:
        """Whether the mode is any other than GROUNDED."""
        return self.mode is not VehicleMode.GROUNDED

    def take_off(self, height: float) -> None:
        """Arm and climb to `height` metres above the ground."""
        x, y, z = self._home = self._believed()
        self.armed = True
        self.mode = VehicleMode.TAKING_OFF
        self.ended, self._lifted = None, False
        self._spooling = _SPOOL_UP
        self._grounded_for = 0.0
        self._target = Goto((x, y, z + height), self._believed_yaw(), self._limits.cruise)

    def guide(self, target: Goto | Steer) -> None:
        """Follow a setpoint."""
        self.mode = VehicleMode.GUIDED
        self._target = target

    def hold(self) -> None:
        """Brake and hold the position; does nothing while already holding."""
        if self.mode is not VehicleMode.HOLDING:
            self.mode = VehicleMode.HOLDING
            self._target = None

    def return_home(self) -> None:
        """Fly level to the takeoff position and land there."""
        self.mode = VehicleMode.RETURNING
        x, y, _ = self._home
        height = self._believed()[2]
        self._target = Goto((x, y, height), self._believed_yaw(), self._limits.cruise)

    def land(self, mode: VehicleMode = VehicleMode.LANDING) -> None:
        """Descend in place; `mode` may be FAILSAFE, which cannot be overridden."""
        self.mode = mode
        x, y, z = self._believed()
        self._target = Goto((x, y, z), self._believed_yaw(), self._limits.cruise)

    def step(self) -> None:
        """Advance by one step of the flight dynamics."""
        rotor, before = self._rotor, self._rotor.position
        powered = self.armed and self.battery.fraction > 0.0
        if powered:
            demand, yaw_rate = self._velocity_setpoint()
            rotor.step(demand, yaw_rate)
        else:
            rotor.step(None, 0.0)
        self._steps += 1
        if self._contacts is not None:
            collision = self._contacts.step(before, self._steps * STEP, powered=powered)
            if collision is not None and self.flying:
                self._collide(collision)
        if self._steps % SensorNoise.PERIOD == 0:
            self._noise.update()
        if self._steps % _POWER_PERIOD == 0:
            power = flight_power(self._airframe, rotor.thrust, rotor.airspeed)
            self.battery.drain(power, STEP * _POWER_PERIOD)
        if self.armed:
            self._change_mode()
        elif self.flying and rotor.on_ground:
            self._change_mode_on_ground()

    def _collide(self, collision: Collision) -> None:
        """Stop the motors; the drone falls."""
        self.collision = self.collision or collision
        self.armed = False

    def _believed(self) -> Triple:
        (x, y, z), (dx, dy, dz) = self._rotor.position, self._noise.drift
        return x + dx, y + dy, z + dz

    def _believed_yaw(self) -> float:
        return self._rotor.yaw + self._noise.yaw_drift

    def _velocity_setpoint(self) -> tuple[Triple | None, float]:
        """Velocity and yaw rate for the next step."""
        if self._spooling > 0.0:
            self._spooling -= STEP
            return None, 0.0
        target = self._target
        if isinstance(target, Steer):
            return target.velocity, target.yaw_rate
        if target is None:
            return (0.0, 0.0, 0.0), 0.0
        velocity = velocity_towards(
            self._believed(),
            target.position,
            speed=target.speed,
            climb=self._limits.climb,
            max_acceleration=self._limits.acceleration,
            passing_speed=target.passing_speed,
        )
        if self.mode in {VehicleMode.LANDING, VehicleMode.FAILSAFE}:
            velocity = (velocity[0], velocity[1], -self._descent())
        return velocity, yaw_rate_towards(self._believed_yaw(), target.yaw)

    def _descent(self) -> float:
        """Descent speed of a landing in m/s, reduced close to the ground."""
        height = self._rotor.position[2] - self._rotor.ground
        slow = self._airframe.landing_speed
        return min(self._limits.climb, max(slow, _FLARE_SPEED_PER_METRE * height))

    def _change_mode(self) -> None:
        mode = self.mode
        if self._rotor.on_ground:
            self._change_mode_on_ground()
            mode = self.mode
        else:
            self._grounded_for, self._lifted = 0.0, True
        if mode is VehicleMode.TAKING_OFF and self._arrived():
            self.hold()
        elif mode is VehicleMode.RETURNING and self._arrived():
            self.land()
        elif mode is VehicleMode.HOLDING and self._target is None and self._standing():
            self._target = Goto(self._believed(), self._believed_yaw(), self._limits.cruise)
        if (
            mode is not VehicleMode.FAILSAFE
            and self.armed
            and self.battery.fraction <= self._airframe.battery_failsafe
        ):
            self.land(VehicleMode.FAILSAFE)

    def _standing(self) -> bool:
        return math.hypot(*self._rotor.velocity) < _STANDING

    def _arrived(self) -> bool:
        target = self._target
        return (
            isinstance(target, Goto)
            and math.dist(self._believed(), target.position) < _ARRIVED
            and math.hypot(*self._rotor.velocity) < _ARRIVED
        )

    def _change_mode_on_ground(self) -> None:
        if self.mode is VehicleMode.TAKING_OFF and self.collision is None:
            return
        self._grounded_for += STEP
        landing = self.mode in {VehicleMode.LANDING, VehicleMode.FAILSAFE}
        if self._rotor.impact > _CRASH_SPEED:
            self._collide(Collision("the ground", self._rotor.position, self._rotor.impact))
        patience = _DISARM_AFTER if landing else _DISARM_GUIDED_AFTER
        if self.collision or self._grounded_for >= patience:
            self.armed = False
            self.mode = VehicleMode.GROUNDED
            self._target = None
            if self._lifted:
                self.ended = FlightEnd.FELL if self.collision else FlightEnd.LANDED
