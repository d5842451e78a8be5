"""The battery pays for what is flown."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.simulation.airframe import GRAVITY, Airframe
from aerodaas.simulation.battery import FlightBattery, flight_power

HOVER = (0.0, 0.0, GRAVITY)
axis = st.floats(-15, 15)


def test_hover_lasts_as_long_as_such_drones_do() -> None:
    """A 2 kg quadrotor on a 4-cell 5 Ah pack hovers for some 20 minutes."""
    battery = FlightBattery(Airframe())
    power = flight_power(Airframe(), HOVER, (0.0, 0.0, 0.0))
    minutes = 0
    while battery.fraction > 0.0:
        battery.drain(power, 60.0)
        minutes += 1
    assert 15 <= minutes <= 25


def test_climbing_costs_and_moderate_speed_saves() -> None:
    """Momentum theory: climb adds power, forward flight cuts the induced part."""
    airframe = Airframe()
    hover = flight_power(airframe, HOVER, (0.0, 0.0, 0.0))
    assert flight_power(airframe, HOVER, (0.0, 0.0, 2.0)) > 1.1 * hover
    assert flight_power(airframe, HOVER, (4.0, 0.0, 0.0)) < hover
    assert flight_power(airframe, HOVER, (0.0, 0.0, -1.0)) < hover


@given(st.tuples(axis, axis, axis), st.tuples(axis, axis, axis), st.floats(0, 1))
def test_charge_only_ever_falls(
    thrust: tuple[float, float, float], airspeed: tuple[float, float, float], charge: float
) -> None:
    """Whatever is flown, the battery loses charge, and stays within 0 to 1."""
    airframe = Airframe(battery=charge)
    battery = FlightBattery(airframe)
    battery.drain(flight_power(airframe, thrust, airspeed), 1.0)
    assert 0.0 <= battery.fraction <= charge
    assert battery.fraction < charge or charge == 0.0


def test_voltage_sags_under_load() -> None:
    """More current, less voltage; an idle full pack shows its full voltage."""
    idle, loaded = FlightBattery(Airframe()), FlightBattery(Airframe())
    idle.drain(1.0, 0.1)
    loaded.drain(400.0, 0.1)
    assert idle.state.voltage == pytest.approx(16.8, abs=0.05)
    assert loaded.state.voltage < idle.state.voltage - 0.3
    assert loaded.state.current == pytest.approx(400.0 / loaded.state.voltage)
