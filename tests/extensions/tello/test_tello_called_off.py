"""A take-off that is called off: a `takeoff` may come after the `land` that takes it back."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
from tello_flights import flight

from aerodaas.extensions.tello.phase import FlightPhase
from aerodaas.extensions.tello.state import TelloState
from aerodaas.messages.vehicle import FlightEnd, VehicleMode
from tools.tello_vehicle import Impairment, TelloOptions


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


@pytest.mark.parametrize(
    ("sinking", "ended", "words"),
    [(0.4, FlightEnd.LANDED, "landed by itself"), (3.5, FlightEnd.FELL, "stopped in flight")],
)
def test_how_a_flight_ended(sinking: float, ended: FlightEnd, words: str) -> None:
    """By itself on a table it has landed; with motors cut it has fallen."""
    phase = FlightPhase()
    phase.to(VehicleMode.TAKING_OFF, 100.0)
    phase.observe(replace(standing(0.0), height=1.5, ground_distance=1.6), 100.0)
    phase.observe(replace(standing(1.0), height=1.5, ground_distance=1.6), 101.0)
    phase.to(VehicleMode.HOLDING, 102.0)
    down = replace(standing(2.0), velocity=(0.0, 0.0, sinking), height=1.0)
    phase.observe(down, 102.1)
    for tenth in range(40):
        on_a_table = replace(standing(2.0), height=0.8)
        phase.observe(on_a_table, 102.2 + tenth / 10)
    assert (phase.mode, phase.ended) == (VehicleMode.FAILSAFE, ended)
    assert words in phase.outcome
    phase.to(VehicleMode.TAKING_OFF, 110.0)
    assert (phase.mode, phase.ended) == (VehicleMode.TAKING_OFF, None)


def test_what_never_lifted_has_not_landed() -> None:
    """A take-off that was called off is no flight."""
    never_lifted = FlightPhase()
    never_lifted.to(VehicleMode.TAKING_OFF, 200.0)
    never_lifted.to(VehicleMode.LANDING, 200.3)
    for tenth in range(60):
        never_lifted.observe(standing(2.0), 200.4 + tenth / 10)
    assert never_lifted.mode is VehicleMode.GROUNDED
    assert never_lifted.ended is None


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
