"""A simulated drone and the objects of its world: what it hits, it does not fly through."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.messages.vehicle import (
    FlightEnd,
    PositionSetpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)

SECOND = 1_000_000_000
HOUSE = {"kind": "building", "id": "house", "at": [10, 0], "yaw": 0, "size": [4, 4, 3]}
FLAT = {**HOUSE, "roof": "flat"}
WALL = 8.0
"""Metres east of home where the house begins."""


class Flight:
    """A drone in a world of these objects, and its time."""

    def __init__(self, folder: Path, *entities: dict[str, Any], **robot: Any) -> None:  # noqa: ANN401
        (folder / "world.json").write_text(json.dumps({"name": "test", "entities": entities}))
        environment = EnvironmentConfig.model_validate(
            {
                "robots": [{"id": "drone", **robot}],
                "simulation": {"world": str(folder / "world.json"), "sensor_noise": 0.0},
            }
        )
        self.vehicle = SimulatedVehicle(environment.robots[0], environment)
        self.vehicle.connect()
        self.now = 0

    def fly(
        self, seconds: float, velocity: tuple[float, float, float] | None = None
    ) -> VehicleState:
        """Let time pass, with this velocity where one is given."""
        for _ in range(round(10 * seconds)):
            if velocity is not None and self.vehicle.read().mode is not VehicleMode.GROUNDED:
                self.vehicle.send(VelocitySetpoint(np.array(velocity)))
            self.now += SECOND // 10
            self.vehicle.advance_to(self.now)
        return self.vehicle.read()

    def hovering(self, height: float = 1.5) -> Flight:
        """Take off."""
        self.vehicle.take_off(height)
        while self.vehicle.read().mode is VehicleMode.TAKING_OFF:
            self.fly(0.1)
        return self

    def to(self, place: tuple[float, float, float], seconds: float, speed: float) -> VehicleState:
        """Fly to a place for some time."""
        self.vehicle.send(PositionSetpoint(np.array(place), speed=speed))
        return self.fly(seconds)


def test_a_drone_that_hits_a_wall_falls(tmp_path: Path) -> None:
    """Its fault names thing, place and speed; it lies before the wall and flies no more."""
    state = Flight(tmp_path, HOUSE).hovering().to((20.0, 0.0, 1.5), 10.0, speed=2.0)
    assert state.ended is FlightEnd.FELL
    assert not state.armed
    (fault,) = state.faults
    assert fault.startswith("collision with building house at (7.8, ")
    assert float(fault.split()[-2]) == pytest.approx(2.0, abs=0.1)
    assert state.odometry.position[0] < WALL - 0.15
    assert state.odometry.height == 0.0


@pytest.mark.parametrize(("speed", "falls"), [(0.45, False), (0.55, True)])
def test_half_a_metre_a_second_is_the_limit(tmp_path: Path, speed: float, *, falls: bool) -> None:
    """A slower drone is stopped by the wall, and can fly away from it."""
    flight = Flight(tmp_path, HOUSE).hovering()
    flight.to((6.5, 0.0, 1.5), 10.0, speed=2.0)
    state = flight.fly(10.0, (speed, 0.0, 0.0))
    assert (state.ended is FlightEnd.FELL) is falls
    assert state.odometry.position[0] < WALL - 0.15
    if not falls:
        assert state.odometry.position[0] == pytest.approx(WALL - 0.2, abs=0.01)
        assert abs(state.odometry.velocity[0]) < 0.05
        assert flight.to((0.0, 0.0, 1.5), 10.0, speed=2.0).odometry.position[0] < 0.1
        assert flight.vehicle.read().faults == ()


@pytest.mark.parametrize("offset", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_a_fast_drone_does_not_pass_through_a_thin_thing(tmp_path: Path, offset: float) -> None:
    """A fence of 0.1 m, at 9 m/s."""
    fence = {"kind": "fence", "id": "fence", "points": [[20, -9], [20, 9]], "height": 3.0}
    fast = {"max_speed": 10, "cruise_speed": 10, "max_acceleration": 8, "max_range": 200}
    flight = Flight(tmp_path, fence, start=(offset, 0.0, 0.0), limits=fast).hovering()
    state = flight.to((60.0, 0.0, 1.5), 10.0, speed=9.0)
    assert state.faults[0].startswith("collision with fence fence")
    assert state.odometry.position[0] < 20.0


def test_a_flight_past_things_is_as_in_an_empty_world(tmp_path: Path) -> None:
    """A metre beside and above the house, to the last digit."""
    states = []
    for entities in ((HOUSE,), ()):
        flight = Flight(tmp_path, *entities).hovering()
        flight.to((4.0, 3.45, 1.5), 5.0, speed=4.0)
        flight.to((14.0, 3.45, 1.5), 5.0, speed=4.0)
        flight.to((14.0, 3.45, 4.9), 4.0, speed=4.0)
        states.append(flight.to((6.0, -2.0, 4.9), 5.0, speed=4.0))
    assert states[0].odometry.position.tolist() == states[1].odometry.position.tolist()
    assert states[0].faults == ()


def test_a_drone_lands_on_a_roof_and_takes_off_from_it(tmp_path: Path) -> None:
    """Slowly; it stands on it with the motors off."""
    flight = Flight(tmp_path, FLAT).hovering(4.0)
    flight.to((10.0, 0.0, 3.6), 15.0, speed=2.0)
    state = flight.fly(3.0, (0.0, 0.0, -0.3))
    assert state.odometry.height == pytest.approx(3.25, abs=0.02)
    assert flight.fly(3.0).ended is FlightEnd.LANDED
    flight.hovering(2.0)
    assert flight.to((0.0, 0.0, 5.0), 10.0, speed=2.0).faults == ()


def test_a_drone_that_falls_on_a_roof_stays_there(tmp_path: Path) -> None:
    """Its flight has ended."""
    flight = Flight(tmp_path, FLAT).hovering(6.0)
    flight.to((10.0, 0.0, 6.0), 15.0, speed=2.0)
    state = flight.fly(5.0, (0.0, 0.0, -2.0))
    assert state.ended is FlightEnd.FELL
    assert state.faults[0].startswith("collision with building house")
    assert state.odometry.height == pytest.approx(3.25, abs=0.05)


@pytest.mark.parametrize("start", [(10.0, 0.0, 0.0), (10.0, 0.0, 3.25), (-3.1, 0.0, 0.0)])
def test_it_takes_off_from_within_upon_and_beside_a_thing(
    tmp_path: Path, start: tuple[float, float, float]
) -> None:
    """A garage, a roof, a fence; coming back to the garage, it hits the wall."""
    fence = {"kind": "fence", "id": "fence", "points": [[-3, -5], [-3, 5]]}
    flight = Flight(tmp_path, FLAT, fence, start=start).hovering(3.0)
    assert flight.to((4.0, 0.0, 6.0), 8.0, speed=2.0).faults == ()
    state = flight.to((4.0, 0.0, 1.5), 8.0, speed=2.0)
    if start[0] == 10.0 and start[2] == 0.0:
        assert flight.to((10.0, 0.0, 1.5), 8.0, speed=2.0).faults != ()
    else:
        assert state.faults == ()


def test_a_drone_that_hits_a_crown_while_it_takes_off_ends_its_flight(tmp_path: Path) -> None:
    """Beneath a tree."""
    tree = {"kind": "tree", "id": "oak", "at": [1.2, 0], "yaw": 0, "height": 8.0}
    flight = Flight(tmp_path, tree)
    flight.vehicle.take_off(8.0)
    state = flight.fly(20.0)
    assert state.mode is VehicleMode.GROUNDED
    assert state.ended is FlightEnd.FELL
    assert "collision with tree oak" in state.faults[0]


def test_a_car_hits_a_hovering_drone(tmp_path: Path) -> None:
    """What counts is the speed of one towards the other."""
    drive = {"points": [[-30, 0], [30, 0]], "speed": 3.0, "variation": 0.0, "start": 5}
    flight = Flight(tmp_path, {"kind": "car", "id": "taxi", "motion": drive}).hovering(1.0)
    fault = flight.fly(20.0).faults[0]
    assert fault.startswith("collision with car taxi at (")
    assert float(fault.split()[-2]) == pytest.approx(3.0, abs=0.2)


def test_a_hard_landing_is_a_collision_with_the_ground(tmp_path: Path) -> None:
    """By the speed downwards."""
    flight = Flight(tmp_path, limits={"max_climb": 3.0}).hovering(8.0)
    state = flight.fly(5.0, (0.0, 0.0, -3.0))
    assert state.ended is FlightEnd.FELL
    assert state.faults[0].startswith("collision with the ground at (")
    assert math.isclose(float(state.faults[0].split()[-2]), 3.0, abs_tol=0.2)
