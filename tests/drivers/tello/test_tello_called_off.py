"""A take-off that is called off: a `takeoff` may come after the `land` that takes it back."""

from __future__ import annotations

import time

import pytest
from tello_flights import flight

from aerodaas.drivers.tello.phase import FlightPhase
from aerodaas.drivers.tello.state import TelloState
from aerodaas.testing.tello import Impairment, TelloOptions
from aerodaas.vehicle import VehicleMode


def standing(motor_time: float = 0.0) -> TelloState:
    """On the ground, its motors' clock at `motor_time`."""
    return TelloState(0, 0, 0, (0.0, 0.0, 0.0), 0.0, 0.1, 100.0, 80, motor_time, 50.0)


def test_motors_that_start_late_are_waited_for() -> None:
    """Not on the ground before it has stood for long enough, and not while motors tick."""
    phase = FlightPhase()
    phase.observe(standing(), 99.9)
    phase.to(VehicleMode.TAKING_OFF, 100.0)
    phase.to(VehicleMode.LANDING, 100.3)
    told = {}
    for tenth in range(4, 50):
        phase.observe(standing(float(tenth >= 30)), 100.0 + tenth / 10)
        told[tenth] = phase.mode
    assert {told[tenth] for tenth in range(4, 45)} == {VehicleMode.LANDING}
    assert told[49] is VehicleMode.GROUNDED


def test_a_landing_after_a_flight_is_told_as_soon_as_it_stands() -> None:
    """The longer wait is for take-offs that were called off alone."""
    phase = FlightPhase()
    phase.to(VehicleMode.TAKING_OFF, 100.0)
    phase.rose()
    phase.to(VehicleMode.LANDING, 110.0)
    phase.observe(standing(9.0), 111.6)
    assert phase.mode is VehicleMode.GROUNDED


@pytest.mark.slow
@pytest.mark.parametrize("tenths", [0, 1, 3, 5, 8, 10])
def test_no_motor_starts_after_the_ground_is_told(tenths: int) -> None:
    """Commands that overtake each other by up to a second, called off within the first."""
    overtaking = Impairment(late=0.5, lateness=1.0)
    with flight(TelloOptions(commands=overtaking, seed=tenths)) as pair:
        pair.vehicle.take_off(1.0)
        time.sleep(tenths / 10)
        pair.vehicle.land()
        assert not pair.until(VehicleMode.GROUNDED, 30.0).armed
        end = time.monotonic() + 4.0
        while time.monotonic() < end:
            assert pair.tello.mode is VehicleMode.GROUNDED
            time.sleep(0.05)
