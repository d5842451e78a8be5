"""The simulated drone behind the same protocol as the real ones.

Its settings in the environment file are those of `aerodaas.simulation.airframe.Airframe`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np

from aerodaas.clock import NANOSECONDS
from aerodaas.config.checked import checked
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.sections.actuators import ACTUATOR_TYPES
from aerodaas.drivers.setpoints import require_finite, slowed
from aerodaas.errors import ClockError, InvalidWaypointError, VehicleError
from aerodaas.messages.health import HealthReadings
from aerodaas.messages.vehicle import (
    Capabilities,
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.simulation.airframe import Airframe, Wind
from aerodaas.simulation.autopilot import Autopilot, FlightLimits, Goto, Steer
from aerodaas.simulation.collision import Obstacles
from aerodaas.simulation.contact import Contacts
from aerodaas.simulation.dynamics import STEP, STEP_NS, Multirotor
from aerodaas.simulation.equipment import simulated_equipment
from aerodaas.simulation.sensors import SensorNoise, SimulatedRangefinder, Surface
from aerodaas.simulation.world import World
from aerodaas.terrain.ground import Ground

__all__ = ["SimulatedVehicle"]

_EXACT = SensorNoise(0.0, "")
"""Noise of scale 0: the true motion."""


class SimulatedVehicle:
    """A quadrotor in the embedded simulator; a `SteppedVehicle`.

    Time moves only in `advance_to`, on a fixed grid, so that the trajectory depends on the seed
    and the commands alone, not on how the caller slices time. One thread at a time may use it.
    Raises ConfigError if the robot's settings are not those of an `Airframe`, and for a world that
    cannot be read.
    """

    settings_model = Airframe
    actuator_types: ClassVar[frozenset[str]] = ACTUATOR_TYPES
    """What it can carry."""

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:
        """Make the drone of `robot`, standing at its start."""
        airframe = checked(Airframe, robot.settings, f"robot {robot.id}: settings")
        limits, simulation, home = robot.limits, environment.simulation, environment.home
        self._name = robot.id
        self._airframe = airframe
        self._origin = home and home.origin
        self._limits = FlightLimits(
            min(limits.max_speed, airframe.max_speed),
            min(limits.max_climb, airframe.max_climb),
            limits.max_acceleration,
            min(limits.cruise_speed, limits.max_speed, airframe.max_speed),
        )
        self._max_yaw_rate = math.radians(limits.max_yaw_rate)
        self._wind = math.hypot(*simulation.wind[:2])
        terrain = Ground.around(robot, environment)
        wind = Wind(simulation.wind, simulation.gust, f"{simulation.seed}/{robot.id}/wind", STEP)
        self._rotor = Multirotor(
            airframe,
            wind,
            max_acceleration=limits.max_acceleration,
            max_yaw_rate=self._max_yaw_rate,
            start=robot.start,
            yaw=math.remainder(math.radians(robot.start_yaw), math.tau),
            terrain=None if terrain is None else terrain.height,
        )
        self._noise = SensorNoise(simulation.sensor_noise, f"{simulation.seed}/{robot.id}/noise")
        world = World.load(simulation)
        obstacles = Obstacles(world)
        contacts = Contacts(obstacles, self._rotor) if obstacles else None
        self._autopilot = Autopilot(airframe, self._rotor, self._noise, self._limits, contacts)
        self._measures_ground = limits.rangefinder_clearance > 0.0
        self._rangefinder = _rangefinder(robot, environment, airframe, terrain, world)
        self._now = 0
        self._steps = 0
        self._connected = False
        self.equipment = simulated_equipment(robot, environment, self._descend)
        """What extensions bring."""

    def _descend(self) -> None:
        """Come down where it is, whatever anybody asks."""
        if self._autopilot.flying:
            self._autopilot.land(VehicleMode.FAILSAFE)

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this driver."""
        return Capabilities(
            "simulated",
            global_position=self._origin is not None,
            max_speed=self._airframe.max_speed,
            max_climb=self._airframe.max_climb,
            alone="a simulated drone ends with its process",
        )

    def connect(self, timeout: float = 10.0) -> None:  # noqa: ARG002 - it is always there
        """Connect, which always succeeds."""
        self._connected = True

    def close(self) -> None:
        """Disconnect; a drone in the air lands by itself as time advances."""
        if self._connected and self._autopilot.flying:
            self._autopilot.land()
        self._connected = False

    def advance_to(self, stamp: int) -> None:
        """Simulate up to mission time `stamp` in ns; raise ClockError if that is in the past."""
        if stamp < self._now:
            raise ClockError(
                f"{self._name}: simulated time cannot run backwards, "
                f"from {self._now} to {stamp} ns; advance to later stamps only"
            )
        awaiting = [one for one in self.equipment if one.awaits_state]
        if awaiting and self._connected:
            # However long the caller's steps are.
            self._advance_to(min(stamp, (self._steps + 1) * STEP_NS))
            state = self.read()
            for one in awaiting:
                one.on_state(state)
        self._advance_to(stamp)

    def _advance_to(self, stamp: int) -> None:
        self._now = stamp
        step = self._autopilot.step
        for _ in range(stamp // STEP_NS - self._steps):
            step()
        self._steps = stamp // STEP_NS
        for one in self.equipment:
            one.advance_to(stamp)

    def read(self) -> VehicleState:
        """Return the state at the time last advanced to."""
        self._require_connection()
        motion = self._rotor.motion((self._now - self._steps * STEP_NS) / NANOSECONDS)
        exact, finder = _EXACT.odometry(motion), self._rangefinder
        state = VehicleState(
            self._now,
            self._noise.odometry(motion),
            self._autopilot.battery.state,
            self._autopilot.mode,
            self._autopilot.armed,
            self._noise.gps(motion, self._origin) if self._origin else None,
            exact,
            tuple(self._faults()),
            ended=self._autopilot.ended,
            below=finder.below(motion, self._now) if finder is not None else None,
        )
        for one in self.equipment:
            state = one.complete(state)
        return state

    def _faults(self) -> list[str]:
        faults = []
        if self._autopilot.collision is not None:
            faults.append(str(self._autopilot.collision))
        left, airframe = self._autopilot.battery.fraction, self._airframe
        if left <= 0.0:
            faults.append("the battery is empty")
        elif left <= airframe.battery_failsafe:
            faults.append(f"the battery is down to {left:.0%}; landing by itself")
        elif left < airframe.battery_minimum:
            faults.append(f"the battery is low: {left:.0%}")
        return faults

    def health(self) -> HealthReadings:
        """Health of the simulated vehicle; raises VehicleError if not connected."""
        self._require_connection()
        cells = self._airframe.cells
        return HealthReadings(
            cells=(self._autopilot.battery.state.voltage / cells,) * cells,
            gps_fix=None if self._origin is None else True,
            wind=self._wind,
            silence=0.0,
        )

    def preflight(self) -> list[str]:
        """Reasons against a take-off now; empty when ready."""
        reasons = []
        if not self._connected:
            reasons.append("not connected")
        if self._autopilot.flying:
            reasons.append(f"already {self._autopilot.mode.value.replace('_', ' ')}")
        if self._autopilot.collision is not None:
            reasons.append("crashed")
        if self._measures_ground and self._rangefinder is None:
            reasons.append(
                "no rangefinder (settings.rangefinder is null), which "
                "limits.rangefinder_clearance relies on"
            )
        left, needed = self._autopilot.battery.fraction, self._airframe.battery_minimum
        if left < needed:
            reasons.append(f"the battery holds {left:.0%}, take-off needs {needed:.0%}")
        return reasons

    def take_off(self, height: float) -> None:
        """Arm and climb to `height` metres; raise VehicleError if preflight has objections."""
        if not (math.isfinite(height) and height > 0.0):
            raise InvalidWaypointError(
                f"{self._name}: the take-off height must be a positive number of metres, "
                f"not {height!r}"
            )
        if reasons := self.preflight():
            raise VehicleError(f"{self._name} refuses to take off: {'; '.join(reasons)}")
        self._autopilot.take_off(height)

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Send one setpoint and return it after clipping to the limits of the drone.

        Raises InvalidWaypointError for numbers that are not finite, and VehicleError on the
        ground, during take-off and when the drone's own protection has taken over.
        """
        require_finite(self._name, setpoint)
        self._require_flight("follow a setpoint")
        if self._autopilot.mode is VehicleMode.TAKING_OFF:
            raise VehicleError(
                f"{self._name} is still taking off; wait for {VehicleMode.HOLDING.value} "
                "before sending setpoints"
            )
        if isinstance(setpoint, VelocitySetpoint):
            return self._send_velocity(setpoint)
        return self._send_position(setpoint)

    def _send_velocity(self, setpoint: VelocitySetpoint) -> VelocitySetpoint:
        x, y, z = (float(axis) for axis in setpoint.velocity)
        across = math.hypot(x, y)
        if across > self._limits.speed:
            x, y = x * self._limits.speed / across, y * self._limits.speed / across
        z = min(max(z, -self._limits.climb), self._limits.climb)
        rate = min(max(float(setpoint.yaw_rate), -self._max_yaw_rate), self._max_yaw_rate)
        self._autopilot.guide(Steer((x, y, z), rate))
        return VelocitySetpoint(np.array([x, y, z]), rate)

    def _send_position(self, setpoint: PositionSetpoint) -> PositionSetpoint:
        x, y, z = (float(axis) for axis in setpoint.position)
        z = max(z, self._rotor.ground)
        sent, speed = slowed(setpoint, self._limits.cruise, self._limits.speed)
        yaw = setpoint.yaw
        facing = self._rotor.yaw + self._noise.yaw_drift if yaw is None else float(yaw)
        self._autopilot.guide(Goto((x, y, z), facing, speed, sent.passing_speed))
        return replace(sent, position=np.array([x, y, z]))

    def hold(self) -> None:
        """Brake and hover; raise VehicleError on the ground."""
        self._require_flight("hold")
        self._autopilot.hold()

    def return_home(self) -> None:
        """Return to the place of take-off and land there; raise VehicleError on the ground."""
        self._require_flight("return home")
        self._autopilot.return_home()

    def land(self) -> None:
        """Land here; does nothing on the ground."""
        self._require_connection()
        if self._autopilot.flying and self._autopilot.mode is not VehicleMode.FAILSAFE:
            self._autopilot.land()

    def _require_connection(self) -> None:
        if not self._connected:
            raise VehicleError(f"{self._name} is not connected; call connect first")

    def _require_flight(self, deed: str) -> None:
        self._require_connection()
        if not self._autopilot.flying:
            raise VehicleError(f"{self._name} cannot {deed} on the ground; take off first")
        if self._autopilot.mode is VehicleMode.FAILSAFE:
            raise VehicleError(f"{self._name} cannot {deed}: it is landing on its last charge")


def _rangefinder(
    robot: RobotConfig,
    environment: EnvironmentConfig,
    airframe: Airframe,
    terrain: Ground | None,
    world: World,
) -> SimulatedRangefinder | None:
    """Its rangefinder; None without one, and where the robot's limits need none."""
    if airframe.rangefinder is None or robot.limits.rangefinder_clearance <= 0.0:
        return None
    simulation = environment.simulation
    return SimulatedRangefinder(
        airframe.rangefinder,
        Surface(world, robot.start[2], None if terrain is None else terrain.heights),
        simulation.sensor_noise,
        f"{simulation.seed}/{robot.id}/rangefinder",
    )
