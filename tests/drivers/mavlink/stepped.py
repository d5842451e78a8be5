"""An emulated autopilot and its driver in one thread, on a clock that the test moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace, TracebackType
from typing import Any

import pytest
from mavlink_flights import LOOPBACK, free_port, robot_of
from typing_extensions import Self

from aerodaas.config.actuators import ActuatorConfig
from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.types.vehicle import PositionSetpoint, VehicleMode, VehicleState
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

__all__ = ["Stepped"]

_STEP = 0.01
"""Seconds between two turns of both ends."""
_TURN = 0.05
"""Seconds between two turns of the control loop."""


class Stepped:
    """Both ends over UDP on loopback, for as long as the `with` lasts.

    Only threads and clocks are taken away: the same seed gives the same flight, and a minute of
    it takes a second or two.
    """

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        options: AutopilotOptions | None = None,
        actuators: Sequence[ActuatorConfig] = (),
        **settings: Any,  # noqa: ANN401
    ) -> None:
        """Connect; `options` of the autopilot, `settings` of the driver."""
        self.now = 1000.0
        clock = SimpleNamespace(monotonic=lambda: self.now, sleep=self.advance)
        services = (f"microservices.{one}" for one in ("actuators", "mission_mode", "payload"))
        controls = ("control.mode_change", "control.watchdog")
        for module in ("vehicle", "connecting", *controls, *services):
            monkeypatch.setattr(f"aerodaas.drivers.mavlink.{module}.time", clock)
        self._links: list[MavlinkLink] = []

        def begin(link: MavlinkLink) -> None:
            self._links.append(link)

        monkeypatch.setattr(MavlinkLink, "_start", begin)
        port = free_port()
        options = replace(options or AutopilotOptions(), peer=(LOOPBACK, port))
        self.autopilot = EmulatedAutopilot(options)
        robot = robot_of(port, failsafes="ignore", fallback="ignore", **settings)
        self.robot = robot = robot.model_copy(update={"actuators": list(actuators)})
        self.vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))

    def __enter__(self) -> Self:
        try:
            self.vehicle.connect(20.0)
        except BaseException:
            self.autopilot.stop()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.vehicle.close()
        self.autopilot.stop()

    def advance(self, duration: float) -> None:
        """Let `duration` seconds pass at both ends."""
        end = self.now + duration - _STEP / 2
        while self.now < end:
            self.now += _STEP
            self.autopilot.turn(self.now)
            if self._links:
                self._links[-1].turn(self.now)

    def turn(self) -> VehicleState:
        """One turn of the control loop."""
        self.advance(_TURN)
        return self.vehicle.read()

    def until(self, *modes: VehicleMode, timeout: float = 30.0) -> VehicleState:
        """Turn the loop until the driver reports one of `modes`."""
        end = self.now + timeout
        while (state := self.turn()).mode not in modes:
            assert self.now < end, f"still {state.mode} after {timeout:g} s"
        return state

    def watch(self, duration: float) -> list[VehicleState]:
        """Turn the loop for `duration` seconds; what the driver reported in each turn."""
        return [self.turn() for _ in range(round(duration / _TURN))]

    def guide(self, height: float = 2.0) -> VehicleState:
        """Take off and stream until the autopilot follows."""
        self.vehicle.take_off(height)
        state = self.until(VehicleMode.HOLDING, VehicleMode.GUIDED)
        here = PositionSetpoint(state.odometry.position)
        for _ in range(200):
            self.vehicle.send(here)
            if (state := self.turn()).mode is VehicleMode.GUIDED:
                return state
        raise AssertionError("it never followed")
