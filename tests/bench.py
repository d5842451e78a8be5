"""The driver and the scripted autopilot that it flies, on one clock, without threads or sockets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from autopilot import ACCEPTED, STEP, STILL, ScriptedAutopilot, robot_of

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire import link as link_module
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.vehicle import VehicleMode

__all__ = ["Bench"]


class Bench:
    """The driver of one robot, and the scripted autopilot that it flies, on one clock."""

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        autopilot: ScriptedAutopilot | None = None,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        self.autopilot = autopilot or ScriptedAutopilot()
        self.clock = self.autopilot.clock
        self.clock.drive(monkeypatch)
        self.clock.turns.insert(0, self.autopilot.speak)
        monkeypatch.setattr(link_module, "open_transport", lambda *_: self.autopilot.wire)
        home = settings.pop("home", None)
        self.robot = robot_of(1, **{"failsafes": "ignore", "fallback": "ignore", **settings})
        environment = {"robots": [self.robot], **({"home": home} if home else {})}
        self.vehicle = MavlinkVehicle(self.robot, EnvironmentConfig.model_validate(environment))

    @property
    def now(self) -> float:
        """Seconds of the clock."""
        return self.clock.now

    def connect(self) -> None:
        """Connect, and forget what was received until then."""
        self.vehicle.connect(5.0)
        self.clock.advance(1.0)
        self.autopilot.received.clear()

    def close(self) -> None:
        """Let go of a vehicle that neither speaks nor answers any more."""
        self.hush()
        self.vehicle.close()

    def turn(self, seconds: float = STEP) -> VehicleMode:
        """Turn the control loop for a while; the mode that it reads at last."""
        mode = self.vehicle.read().mode
        for _ in range(round(seconds / STEP)):
            self.clock.advance(STEP)
            mode = self.vehicle.read().mode
        return mode

    def hush(self, *, off: bool = False) -> None:
        """Have the autopilot say nothing at all, or speak again."""
        self.autopilot.speaks, self.autopilot.result = off, ACCEPTED if off else None

    def fly(self, height: float = 5.0, mode: FlightMode = FlightMode.HOLD) -> None:
        """Be found in the air, `height` metres above where it was armed, after a take-off."""
        self.vehicle.take_off(height)
        self.autopilot.mode = FlightMode.HOLD if self.autopilot.family == "px4" else mode
        self.turn(0.2)
        self.lift()
        self.rise(height)
        self.autopilot.mode = mode
        self.turn(0.5)
        self.autopilot.received.clear()

    def lift(self) -> None:
        """Start its motors, and leave the ground in the mode of a take-off."""
        self.autopilot.armed = True
        self.turn(0.2)
        if self.autopilot.family == "px4":
            self.autopilot.mode = FlightMode.TAKE_OFF
        self.autopilot.landed = mavlink.MAV_LANDED_STATE_IN_AIR

    def rise(self, metres: float) -> None:
        """Rise at 2 m/s, and stop there."""
        self.autopilot.velocity = np.array([0.0, 0.0, -2.0])
        for _ in range(round(10 * metres)):
            self.autopilot.position = self.autopilot.position - np.array([0.0, 0.0, 0.1])
            self.turn()
        self.autopilot.velocity = np.zeros(3)
        self.turn()

    def guide(self) -> None:
        """Fly, and follow a stream of setpoints."""
        self.fly()
        for _ in range(40):
            self.vehicle.send(STILL)
            self.turn()
        self.autopilot.mode = FlightMode.GUIDED
        for _ in range(5):
            self.vehicle.send(STILL)
            self.turn()
        assert self.turn() is VehicleMode.GUIDED
        self.autopilot.received.clear()
