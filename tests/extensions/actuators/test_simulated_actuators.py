"""The simulated drone's actuators: at their time, and a parachute that ends the flight."""

from __future__ import annotations

import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.extensions.actuators.equipment import Actuators, MoveResult
from aerodaas.messages.vehicle import VehicleMode, equipment_of

CARRIED = [
    {"id": "hook", "type": "gripper"},
    {"id": "pump", "type": "relay"},
    {"id": "chute", "type": "parachute", "may_release": True},
]


@pytest.fixture
def vehicle() -> SimulatedVehicle:
    """One that carries them, connected."""
    config: EnvironmentConfig = validated(
        {"robots": [{"id": "drone", "actuators": CARRIED}]}, "test"
    )
    made = SimulatedVehicle(config.robots[0], config)
    made.connect()
    return made


def actuators_of(vehicle: SimulatedVehicle) -> Actuators:
    """What it carries."""
    actuators = equipment_of(vehicle, Actuators)
    assert actuators is not None
    return actuators


def test_a_position_is_taken_after_its_time(vehicle: SimulatedVehicle) -> None:
    """And then told, once; nothing is known of what was not moved."""
    actuators = actuators_of(vehicle)
    assert vehicle.read().actuators == {}
    number = actuators.move("hook", "release")
    vehicle.advance_to(NANOSECONDS // 2)
    assert vehicle.read().actuators == {}
    assert actuators.results() == []
    vehicle.advance_to(2 * NANOSECONDS)
    assert vehicle.read().actuators == {"hook": "release"}
    assert actuators.results() == [MoveResult(number, accepted=True)]
    assert actuators.results() == []


def test_what_is_withdrawn_in_time_is_not_done(vehicle: SimulatedVehicle) -> None:
    """As over a radio link that was slow."""
    actuators = actuators_of(vehicle)
    actuators.withdraw(actuators.move("hook", "release"))
    vehicle.advance_to(2 * NANOSECONDS)
    assert vehicle.read().actuators == {}
    assert actuators.results() == []


def test_a_parachute_brings_it_down_whatever_is_asked(vehicle: SimulatedVehicle) -> None:
    """In a mode that nobody overrides."""
    vehicle.take_off(5.0)
    vehicle.advance_to(10 * NANOSECONDS)
    assert vehicle.read().mode is VehicleMode.HOLDING
    actuators_of(vehicle).release_parachute("chute")
    vehicle.advance_to(11 * NANOSECONDS)
    assert vehicle.read().mode is VehicleMode.FAILSAFE
    vehicle.land()
    vehicle.advance_to(60 * NANOSECONDS)
    state = vehicle.read()
    assert state.mode is VehicleMode.GROUNDED
    assert state.actuators == {"chute": "released"}
