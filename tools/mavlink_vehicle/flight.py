"""The emulated vehicle's flight: the embedded simulator, seen in its own NED frame."""

from __future__ import annotations

import math

import numpy as np

from aerodaas.geometry.frames import GeodeticOrigin, Vector, enu_to_ned, wrap_angle
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.simulation.airframe import Airframe, Wind
from aerodaas.simulation.autopilot import FlightLimits, Steer
from aerodaas.simulation.dynamics import STEP, Multirotor
from aerodaas.simulation.sensors import SensorNoise
from tools.emulated import EmulatedFlight
from tools.mavlink_vehicle.options import AutopilotOptions

__all__ = ["GuidedTarget", "MavFlight"]

_SPEED, _CLIMB, _ACCELERATION, _TURN = 12.0, 3.0, 4.0, math.radians(120.0)
_POSITION_GAIN = 1.0
"""1/s, about that of both autopilots."""
_YAW_GAIN = 2.0


class GuidedTarget:
    """The latest setpoint in ENU; None where it was to be ignored."""

    def __init__(
        self,
        position: Vector | None,
        velocity: Vector | None,
        yaw: float | None,
        yaw_rate: float | None,
    ) -> None:
        self.position = position
        self.velocity = velocity
        self.yaw = yaw
        self.yaw_rate = yaw_rate


class MavFlight(EmulatedFlight):
    """Body, motion and battery of a multicopter; time moves in `advance`."""

    def __init__(self, options: AutopilotOptions) -> None:
        """Stand where `options` say."""
        airframe = Airframe(battery=options.battery)
        yaw = wrap_angle(math.radians(options.start_yaw))
        rotor = Multirotor(
            airframe,
            Wind(options.wind, options.gust, f"{options.seed}/wind", STEP),
            max_acceleration=_ACCELERATION,
            max_yaw_rate=_TURN,
            start=options.start,
            yaw=yaw,
        )
        self._noise = SensorNoise(options.noise, f"{options.seed}/noise")
        limits = FlightLimits(_SPEED, _CLIMB, _ACCELERATION, 2.0)
        super().__init__(airframe, rotor, limits, self._noise)
        self._shift = np.array(options.estimator_origin)
        latitude, longitude, self._sea_level = options.origin
        self.origin = GeodeticOrigin(latitude, longitude)
        self.target: GuidedTarget | None = None
        self.fastest = _SPEED
        """Metres a second over ground towards a target."""

    @property
    def believed(self) -> Odometry:
        """What its estimator says, ENU."""
        return self._noise.odometry(self._rotor.motion())

    @property
    def ned(self) -> Vector:
        """Its place in its own NED frame."""
        return enu_to_ned(self.believed.position - self._shift)

    def enu(self, ned: Vector) -> Vector:
        """A place of its own NED frame in ENU."""
        place: Vector = enu_to_ned(ned) + self._shift
        return place

    @property
    def altitude(self) -> float:
        """Metres above mean sea level."""
        return self._sea_level + float(self.believed.position[2])

    def rise_to(self, altitude: float) -> float:
        """Metres from here up to an altitude above mean sea level."""
        return altitude - self.altitude

    @property
    def voltage(self) -> float:
        """Of the battery."""
        return self._autopilot.battery.state.voltage

    def take_off(self, height: float) -> None:
        """Rise by `height` metres."""
        self.target = None
        self._autopilot.take_off(height)

    def hold(self) -> None:
        """Stay."""
        self.target = None
        if self.flying:
            self._autopilot.hold()

    def return_home(self) -> None:
        """Fly home and land."""
        self.target = None
        if self.flying:
            self._autopilot.return_home()

    def land(self) -> None:
        """Land here."""
        self.target = None
        if self.flying:
            self._autopilot.land()

    def drop(self) -> None:
        """Stop its motors wherever it is."""
        self.target = None
        self._autopilot.armed = False
        self._autopilot.mode = VehicleMode.GROUNDED

    def begin_frame_here(self) -> None:
        """Begin the local frame anew where it is."""
        self._shift = self.believed.position

    def shift_frame(self, by: Vector) -> None:
        """Believe from now on to be elsewhere in the local frame, by NED metres."""
        self._shift = self._shift - enu_to_ned(by)

    def advance(self, duration: float) -> None:
        """Fly on for `duration` seconds, in whole steps of the simulator."""
        for _ in range(round(duration / STEP)):
            if self.target is not None and self.flying:
                self._autopilot.guide(self._steer(self.target))
            self._autopilot.step()

    def _steer(self, target: GuidedTarget) -> Steer:
        believed = self.believed
        velocity = np.zeros(3) if target.velocity is None else target.velocity
        if target.position is not None:
            velocity = velocity + _POSITION_GAIN * (target.position - believed.position)
        across = float(np.linalg.norm(velocity[:2]))
        if across > self.fastest:
            share = self.fastest / across
            velocity = velocity * np.array([share, share, 1.0])
        rate = target.yaw_rate or 0.0
        if target.yaw is not None:
            rate = _YAW_GAIN * wrap_angle(target.yaw - believed.yaw)
        x, y, z = velocity
        climb = float(np.clip(z, -_CLIMB, _CLIMB))
        return Steer((float(x), float(y), climb), float(np.clip(rate, -_TURN, _TURN)))
