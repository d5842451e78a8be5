"""A simulated drone over a terrain: it stands, lands and crashes where the ground is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elevation_files import hgt

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.messages.vehicle import FlightEnd, PositionSetpoint, VehicleMode, VehicleState

SECOND = 1_000_000_000
START = 3.0
SLOPE = 0.1
"""Metres that the ground rises a metre to the east."""


class Flight:
    """A drone at 2 m above its start, on a slope."""

    def __init__(self, folder: Path, step: float = 0.1) -> None:
        across = 111_320.0 * np.cos(np.radians(47.1))
        rise = SLOPE * across
        tile = hgt(
            folder,
            "N47E008",
            lambda y, x: np.clip(600.0 + rise * (x - 8.1) + 0 * y, 0.0, 1200.0),
            side=3601,
        )
        limits = {"takeoff_height": 6.0, "max_range": 200.0}
        environment = EnvironmentConfig.model_validate(
            {
                "home": {"latitude": 47.1, "longitude": 8.1, "altitude": 600.0},
                "terrain": {"files": [str(tile)]},
                "simulation": {"sensor_noise": 0.0},
                "robots": [{"id": "drone", "start": [0.0, 0.0, START], "limits": limits}],
            }
        )
        self.vehicle = SimulatedVehicle(environment.robots[0], environment)
        self.vehicle.connect()
        self.step = step
        self.vehicle.take_off(2.0)
        self.until(VehicleMode.HOLDING)

    def until(self, mode: VehicleMode, east: float | None = None) -> VehicleState:
        """Let time pass until it is in `mode`, and `east` is reached."""
        now = self.vehicle.read().stamp
        for _ in range(round(120.0 / self.step)):
            now += round(self.step * SECOND)
            self.vehicle.advance_to(now)
            state = self.vehicle.read()
            place = state.odometry.position[0]
            if state.mode is mode and (east is None or abs(place - east) < 0.3):
                return state
        raise AssertionError(f"never {mode.value} at {east}: {self.vehicle.read()}")


@pytest.mark.parametrize("east", [-60.0, -20.0, 30.0])
def test_it_lands_on_the_ground_that_is_there(tmp_path: Path, east: float) -> None:
    """Higher and lower than where it took off."""
    flight = Flight(tmp_path)
    flight.vehicle.send(PositionSetpoint(np.array([east, 0.0, 12.0]), speed=3.0))
    flight.until(VehicleMode.GUIDED, east)
    flight.vehicle.land()
    state = flight.until(VehicleMode.GROUNDED)
    assert state.ended is FlightEnd.LANDED
    assert state.odometry.height == pytest.approx(START + SLOPE * east, abs=1.5)


def test_it_crashes_into_a_hill(tmp_path: Path) -> None:
    """Level at 2 m the slope is met 20 m to the east."""
    flight = Flight(tmp_path)
    flight.vehicle.send(PositionSetpoint(np.array([60.0, 0.0, START + 2.0]), speed=4.0))
    state = flight.until(VehicleMode.GROUNDED)
    assert state.ended is FlightEnd.FELL
    assert state.odometry.position[0] == pytest.approx(20.0, abs=16.0)
    assert any("collision with the ground" in fault for fault in state.faults)


def test_the_ground_does_not_depend_on_how_time_is_sliced(tmp_path: Path) -> None:
    """The same landing, in long steps and in short ones."""
    ends = []
    for step in (0.01, 0.1):
        flight = Flight(tmp_path, step)
        flight.vehicle.land()
        flight.until(VehicleMode.GROUNDED)
        flight.vehicle.advance_to(60 * SECOND)
        ends.append(flight.vehicle.read().odometry.position.tolist())
    assert ends[0] == ends[1]
