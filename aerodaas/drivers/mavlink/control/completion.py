"""Completion of a take-off by setpoints: PX4 ends its own up to 0.8 m below the height."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.geometry.frames import Vector
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint

__all__ = ["ClimbCompletion"]


class ClimbCompletion:
    """Setpoints from where an autopilot's take-off has ended up to the commanded height."""

    def __init__(self, telemetry: Telemetry, phase: FlightPhase) -> None:
        """Judge by these."""
        self._telemetry = telemetry
        self._phase = phase
        self._place: Vector | None = None

    def begin(self) -> None:
        """Forget the place of an earlier take-off."""
        self._place = None

    def setpoint(
        self,
        goal: float,
        frame: LocalFrame,
        odometry: Callable[[], Odometry],
        climb: float,
        *,
        near: bool,
    ) -> PositionSetpoint | None:
        """The setpoint that completes a climb to `goal`; None if none is due.

        PX4 reports hold before it takes off, too. Once commanded to follow setpoints, it gets them,
        whatever it shows: without, it would leave that mode by its own protection.

        Args:
            goal: Metres up in the autopilot's frame.
            frame: The autopilot's frame.
            odometry: Where the vehicle is.
            climb: Climb rate, m/s.
            near: Whether it flies so high that the autopilot may have ended its take-off.
        """
        phase = self._phase
        done = phase.seen and phase.shown in {FlightMode.HOLD, FlightMode.GUIDED}
        if not ((done and near) or phase.wish is FlightMode.GUIDED):
            return None
        if self._place is None:
            self._place = odometry().position
        top = frame.position(np.array([0.0, 0.0, -goal]))[2]
        return PositionSetpoint(np.array([*self._place[:2], top]), None, climb)
