"""The emulated Tello's flight: the embedded simulator with a Tello's body and sensors."""

from __future__ import annotations

import math

import numpy as np

from aerodaas.geometry.frames import enu_to_body, wrap_angle
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.simulation.airframe import Airframe, Wind
from aerodaas.simulation.autopilot import FlightLimits, Goto, Steer
from aerodaas.simulation.dynamics import STEP, Multirotor
from tools.emulated import EmulatedFlight
from tools.tello_vehicle.options import TelloOptions

__all__ = ["TelloFlight"]

_RISE = 0.8
"""Metres to which `takeoff` rises."""
_TURN = math.radians(100.0)
"""rad/s at most."""
_SPEED = 8.0
"""m/s by the data sheet; the sticks ask for less."""
_ACCELERATION = 3.0
_LEAST_TOF, _TOF_RANGE, _OUT_OF_RANGE = 10, 850, 6553
"""Centimetres of the time-of-flight sensor: on the ground, at most, and its value beyond."""
_SEA_LEVEL = 100.0
"""Metres that the barometer reads on the ground."""
_THERE, _FACING = 0.1, math.radians(3.0)


class TelloFlight(EmulatedFlight):
    """Body, autopilot, battery and state string; time moves in `advance`."""

    def __init__(self, options: TelloOptions) -> None:
        """Stand at the place of `options`."""
        # 80 g with propellers of 3 inches, one cell of 1.1 Ah: 13 minutes by the data sheet.
        airframe = Airframe(
            mass=0.08,
            rotor_radius=0.038,
            efficiency=0.4,
            avionics_power=3.0,
            max_speed=_SPEED,
            max_climb=2.0,
            cells=1,
            cell_resistance=0.03,
            capacity=options.capacity,
            battery=options.battery,
            battery_minimum=0.1,
            battery_failsafe=0.05,
        )
        self._options = options
        yaw = math.radians(options.start_yaw)
        self._switched_on_yaw = yaw - math.radians(options.switched_on_yaw)
        wind = Wind(options.wind, options.gust, f"{options.seed}/wind", STEP)
        rotor = Multirotor(
            airframe,
            wind,
            max_acceleration=_ACCELERATION,
            max_yaw_rate=_TURN,
            start=options.start,
            yaw=wrap_angle(yaw),
        )
        limits = FlightLimits(_SPEED, 2.0, _ACCELERATION, 1.0)
        super().__init__(airframe, rotor, limits)
        self._sticks: tuple[float, float, float, float] | None = None
        self._goal: Goto | None = None
        self._turning = 0.0
        self._motors = 0.0
        self._time = 0.0

    @property
    def settled(self) -> bool:
        """True once the latest take-off, landing, move or turn is done."""
        if self.mode in {VehicleMode.TAKING_OFF, VehicleMode.LANDING, VehicleMode.FAILSAFE}:
            return False
        return self._goal is None and self._turning == 0.0

    def advance(self, duration: float) -> None:
        """Fly on for `duration` seconds, in whole steps of the simulator."""
        for _ in range(round(duration / STEP)):
            self._guide()
            self._autopilot.step()
            self._time += STEP
            if self._autopilot.armed:
                self._motors += STEP

    def take_off(self) -> None:
        """Rise."""
        self._release()
        self._autopilot.take_off(_RISE)

    def land(self) -> None:
        """Land here."""
        self._release()
        self._autopilot.land()

    def stop(self) -> None:
        """Hover."""
        self._release()
        self._autopilot.hold()

    def cut(self) -> None:
        """Stop the motors, wherever it is."""
        self._release()
        self._autopilot.armed = False
        self._autopilot.mode = VehicleMode.GROUNDED

    def steer(self, right: int, ahead: int, up: int, clockwise: int) -> None:
        """Set the sticks, in percent; they hold until they are set again."""
        speed, turn = self._options.stick_speed, math.radians(self._options.stick_turn)
        self._release()
        self._sticks = (
            ahead / 100 * speed,
            -right / 100 * speed,
            up / 100 * speed,
            -clockwise / 100 * turn,
        )

    def move(self, ahead: float, left: float, up: float, speed: float) -> None:
        """Fly to a place relative to this one: metres in the level body frame, m/s."""
        self._release()
        here, yaw = self.truth, self._rotor.yaw
        way = (ahead * np.array([math.cos(yaw), math.sin(yaw), 0.0])) + (
            left * np.array([-math.sin(yaw), math.cos(yaw), 0.0])
        )
        x, y, z = here.position + way + np.array([0.0, 0.0, up])
        self._goal = Goto((float(x), float(y), float(z)), yaw, speed)
        self._autopilot.guide(self._goal)

    def turn(self, degrees: float) -> None:
        """Turn on the spot, counter-clockwise if positive."""
        self._release()
        self._turning = math.radians(degrees)

    def _release(self) -> None:
        self._sticks = self._goal = None
        self._turning = 0.0

    def _guide(self) -> None:
        """Renew the autopilot's target: sticks and turns are relative to where it looks."""
        if self._autopilot.mode in {
            VehicleMode.GROUNDED,
            VehicleMode.TAKING_OFF,
            VehicleMode.LANDING,
            VehicleMode.FAILSAFE,
        }:
            self._release()
            return
        if self._sticks is not None:
            ahead, left, up, rate = self._sticks
            c, s = math.cos(self._rotor.yaw), math.sin(self._rotor.yaw)
            velocity = (c * ahead - s * left, s * ahead + c * left, up)
            self._autopilot.guide(Steer(velocity, rate))
        elif self._turning != 0.0:
            rate = math.copysign(min(_TURN, 0.3 + abs(self._turning)), self._turning)
            before = self._turning
            self._turning -= self._rotor.yaw_rate * STEP
            done = abs(self._turning) < _FACING or before * self._turning < 0.0
            self._turning = 0.0 if done else self._turning
            self._autopilot.guide(Steer((0.0, 0.0, 0.0), 0.0 if done else rate))
        elif self._goal is not None and self._at(self._goal):
            self._goal = None
            self._autopilot.hold()

    def _at(self, goal: Goto) -> bool:
        return math.dist(self._rotor.position, goal.position) < _THERE

    def state(self) -> str:
        """Return the state string, with the resolution of the real one."""
        truth = self.truth
        ahead, left, up = enu_to_body(truth.velocity, self._switched_on_yaw)
        rise = float(truth.position[2]) - self._rotor.ground
        tof = round(100 * rise) + _LEAST_TOF
        yaw = math.degrees(wrap_angle(self._switched_on_yaw - truth.yaw))
        x, y, z = self._rotor.acceleration
        fields = {
            "mid": "-1",
            "x": "-100",
            "y": "-100",
            "z": "-100",
            "mpry": "0,0,0",
            "pitch": f"{-math.degrees(truth.pitch):.0f}",
            "roll": f"{math.degrees(truth.roll):.0f}",
            "yaw": f"{yaw:.0f}",
            "vgx": f"{10 * ahead:.0f}",
            "vgy": f"{-10 * left:.0f}",
            "vgz": f"{-10 * up:.0f}",
            "templ": f"{self._options.temperature - 3:.0f}",
            "temph": f"{self._options.temperature:.0f}",
            "tof": str(tof if tof <= _TOF_RANGE else _OUT_OF_RANGE),
            "h": str(10 * round(10 * rise)),
            "bat": f"{100 * self.charge:.0f}",
            "baro": f"{_SEA_LEVEL + rise:.2f}",
            "time": str(int(self._motors)),
            "agx": f"{-100 * x:.2f}",
            "agy": f"{100 * y:.2f}",
            "agz": f"{-1000 - 100 * z:.2f}",
        }
        return "".join(f"{name}:{value};" for name, value in fields.items()) + "\r\n"
