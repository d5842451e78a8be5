"""The simulated drone flies what it is told, refuses what it must, and repeats itself exactly."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.config.model import EnvironmentConfig, HomeConfig, RobotConfig, SimulationConfig
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.errors import ClockError, ConfigError, InvalidWaypointError, VehicleError
from aerodaas.messages.vehicle import (
    FlightEnd,
    PositionSetpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)

SECOND = 1_000_000_000


class Flight:
    """A vehicle and its time."""

    def __init__(self, settings: dict[str, Any] | None = None, **simulation: object) -> None:
        robot = RobotConfig(id="drone", settings=settings or {})
        environment = EnvironmentConfig(
            robots=[robot],
            simulation=SimulationConfig.model_validate({"sensor_noise": 0.0} | simulation),
            home=HomeConfig(latitude=12.97, longitude=77.59, altitude=920.0),
        )
        self.vehicle = SimulatedVehicle(robot, environment)
        self.vehicle.connect()
        self.now = 0

    def fly(self, duration: float) -> VehicleState:
        """Let `duration` seconds pass."""
        self.now += round(duration * SECOND)
        self.vehicle.advance_to(self.now)
        return self.vehicle.read()

    def until(self, mode: VehicleMode, timeout: float = 60.0) -> VehicleState:
        """Let time pass until the vehicle is in `mode`."""
        for _ in range(int(timeout / 0.1)):
            state = self.fly(0.1)
            if state.mode is mode:
                return state
        raise AssertionError(f"never {mode.value}, still {self.vehicle.read().mode.value}")

    def hovering(self, height: float = 1.5) -> Flight:
        """Take off."""
        self.vehicle.take_off(height)
        self.until(VehicleMode.HOLDING)
        return self


def test_a_flight_from_the_ground_and_back() -> None:
    """Take-off, a position with yaw, return and landing pass through their modes."""
    flight = Flight()
    vehicle = flight.vehicle
    assert vehicle.preflight() == []
    vehicle.take_off(2.0)
    assert flight.fly(0.5).mode is VehicleMode.TAKING_OFF
    state = flight.until(VehicleMode.HOLDING)
    assert state.armed
    assert state.odometry.height == pytest.approx(2.0, abs=0.15)
    vehicle.send(PositionSetpoint(np.array([4.0, -3.0, 3.0]), yaw=2.0, speed=2.0))
    state = flight.fly(8.0)
    assert state.mode is VehicleMode.GUIDED
    assert state.odometry.position == pytest.approx(np.array([4.0, -3.0, 3.0]), abs=0.05)
    assert state.odometry.yaw == pytest.approx(2.0, abs=0.02)
    vehicle.return_home()
    assert flight.fly(1.0).mode is VehicleMode.RETURNING
    flight.until(VehicleMode.LANDING)
    state = flight.until(VehicleMode.GROUNDED)
    assert not state.armed
    assert state.ended is FlightEnd.LANDED
    assert state.faults == ()
    assert state.odometry.height == 0.0
    assert state.odometry.position[:2] == pytest.approx(np.zeros(2), abs=0.3)


@settings(max_examples=10)
@given(
    st.tuples(st.floats(-15, 15), st.floats(-15, 15), st.floats(0.5, 8)),
    st.floats(0.3, 5),
    st.integers(0, 1000),
)
def test_a_position_is_reached_in_wind_within_its_speed(
    target: tuple[float, float, float], speed: float, seed: int
) -> None:
    """Any place is reached and held, at no more than the speed asked for (and a gust)."""
    flight = Flight(wind=(2.0, 1.0, 0.0), gust=0.3, seed=seed).hovering()
    flight.vehicle.send(PositionSetpoint(np.array(target), speed=speed))
    states = [flight.fly(0.1) for _ in range(int(10 * (8 + 25 / speed)))]
    assert np.linalg.norm(states[-1].odometry.position - np.array(target)) < 0.25
    assert max(np.hypot(*state.odometry.velocity[:2]) for state in states) < speed + 0.3


@settings(max_examples=15)
@given(st.lists(st.integers(1, 400_000_000), min_size=1, max_size=40), st.integers(0, 99))
def test_slicing_time_changes_nothing(slices: list[int], seed: int) -> None:
    """One advance or many, with reads in between: the same state to the last digit."""
    total = sum(slices)
    states = []
    for cuts in ([total], slices):
        flight = Flight(wind=(1.0, 0.0, 0.0), gust=1.0, seed=seed, sensor_noise=1.0)
        flight.hovering().vehicle.send(VelocitySetpoint(np.array([1.0, 0.5, 0.2]), 0.4))
        for cut in cuts:
            flight.now += cut
            flight.vehicle.advance_to(flight.now)
            flight.vehicle.read()
        states.append(flight.vehicle.read())
    one, many = states
    assert np.array_equal(one.odometry.position, many.odometry.position)
    assert np.array_equal(one.odometry.velocity, many.odometry.velocity)
    assert one.odometry.yaw == many.odometry.yaw
    assert one.battery == many.battery
    assert one.gps == many.gps


def test_the_seed_decides() -> None:
    """Equal seeds fly equal flights; with wind, different seeds fly different ones."""

    def path(seed: int) -> list[float]:
        flight = Flight(gust=0.7, seed=seed, sensor_noise=1.0).hovering()
        flight.vehicle.send(PositionSetpoint(np.array([5.0, 5.0, 2.0])))
        states = [flight.fly(0.5) for _ in range(8)]
        return [float(value) for state in states for value in state.odometry.position]

    assert path(3) == path(3)
    assert path(3) != path(4)


def test_truth_and_belief_part_with_noise() -> None:
    """What it believes is near the truth but not the truth; the truth is always told."""
    state = Flight(sensor_noise=1.0).hovering().fly(30.0)
    assert state.truth is not None
    error = float(np.linalg.norm(state.truth.position - state.odometry.position))
    assert 0.0 < error < 0.5
    assert state.odometry.position_sigma > 0.0


def test_the_battery_falls_all_along() -> None:
    """Every second of flight costs charge."""
    flight = Flight().hovering()
    charges = [flight.fly(1.0).battery.fraction for _ in range(10)]
    assert charges == sorted(charges, reverse=True)
    assert len(set(charges)) == len(charges)


def test_a_low_battery_refuses_take_off_and_lands_by_itself() -> None:
    """Preflight tells; in the air the drone's own protection lands it and takes no orders."""
    flight = Flight({"battery": 0.1})
    with pytest.raises(VehicleError, match="10%"):
        flight.vehicle.take_off(1.5)
    flight = Flight({"battery": 0.06, "battery_minimum": 0.05}).hovering(5.0)
    flight.until(VehicleMode.FAILSAFE)
    with pytest.raises(VehicleError, match="last charge"):
        flight.vehicle.send(VelocitySetpoint(np.zeros(3)))
    assert not flight.until(VehicleMode.GROUNDED).armed


def test_how_a_flight_ended_is_said_when_it_has() -> None:
    """Not before, not in the next one, and not of one that never lifted."""
    flight = Flight()
    assert flight.fly(0.1).ended is None
    flight.vehicle.take_off(2.0)
    flight.vehicle.land()
    assert flight.until(VehicleMode.GROUNDED).ended is None
    flight.vehicle.take_off(2.0)
    assert flight.until(VehicleMode.HOLDING).ended is None
    flight.vehicle.land()
    assert flight.until(VehicleMode.GROUNDED).ended is FlightEnd.LANDED
    flight.vehicle.take_off(2.0)
    assert flight.fly(0.1).ended is None


def test_an_empty_battery_falls_down() -> None:
    """Without charge there is no thrust, and the crash is told."""
    settings_ = {"battery": 0.004, "battery_minimum": 0.0, "battery_failsafe": 0.0}
    flight = Flight(settings_)
    flight.vehicle.take_off(20.0)
    state = flight.until(VehicleMode.GROUNDED)
    assert any("collision with the ground" in fault for fault in state.faults)
    assert state.ended is FlightEnd.FELL
    assert "crashed" in flight.vehicle.preflight()


def test_commands_are_clipped_and_told_as_sent() -> None:
    """Speed, climb, yaw rate and the ground bound what is sent."""
    flight = Flight().hovering()
    sent = flight.vehicle.send(VelocitySetpoint(np.array([30.0, 40.0, 9.0]), 10.0))
    assert isinstance(sent, VelocitySetpoint)
    assert sent.velocity == pytest.approx(np.array([3.0, 4.0, 1.5]))
    assert sent.yaw_rate == pytest.approx(math.radians(90))
    where = flight.vehicle.send(PositionSetpoint(np.array([1.0, 1.0, -5.0]), speed=50.0))
    assert isinstance(where, PositionSetpoint)
    assert where.position[2] == 0.0
    assert (where.speed, where.passing_speed) == (5.0, 0.0)
    passed = PositionSetpoint(np.array([9.0, 1.0, 2.0]), speed=2.0, passing_speed=9.0)
    assert flight.vehicle.send(passed) == replace(passed, passing_speed=2.0)
    with pytest.raises(InvalidWaypointError, match="passing_speed must not be negative"):
        flight.vehicle.send(replace(passed, passing_speed=-1.0))


@pytest.mark.parametrize(
    "setpoint",
    [
        VelocitySetpoint(np.array([math.nan, 0.0, 0.0])),
        VelocitySetpoint(np.zeros(3), math.inf),
        PositionSetpoint(np.array([0.0, math.inf, 1.0])),
        PositionSetpoint(np.zeros(3), yaw=math.nan),
        PositionSetpoint(np.zeros(3), speed=0.0),
        PositionSetpoint(np.zeros(2)),
    ],
)
def test_impossible_setpoints_are_refused(setpoint: PositionSetpoint | VelocitySetpoint) -> None:
    """A refusal names the drone and leaves it holding."""
    flight = Flight().hovering()
    with pytest.raises(InvalidWaypointError, match="drone"):
        flight.vehicle.send(setpoint)
    assert flight.fly(1.0).mode is VehicleMode.HOLDING


def test_orders_out_of_place_are_refused() -> None:
    """On the ground, during take-off and before connecting, the refusal says what to do."""
    flight = Flight()
    for order in (flight.vehicle.hold, flight.vehicle.return_home):
        with pytest.raises(VehicleError, match="take off first"):
            order()
    with pytest.raises(InvalidWaypointError, match="height"):
        flight.vehicle.take_off(math.nan)
    flight.vehicle.take_off(1.5)
    with pytest.raises(VehicleError, match="still taking off"):
        flight.vehicle.send(VelocitySetpoint(np.zeros(3)))
    with pytest.raises(VehicleError, match="already taking off"):
        flight.vehicle.take_off(1.5)
    flight.fly(1.0)
    with pytest.raises(ClockError, match="backwards"):
        flight.vehicle.advance_to(0)
    flight.vehicle.close()
    with pytest.raises(VehicleError, match="connect first"):
        flight.vehicle.read()


def test_a_drone_let_go_in_the_air_lands() -> None:
    """Closing is safe: time alone brings it down."""
    flight = Flight().hovering()
    flight.vehicle.close()
    flight.now += 20 * SECOND
    flight.vehicle.advance_to(flight.now)
    flight.vehicle.connect()
    assert flight.vehicle.read().mode is VehicleMode.GROUNDED


def test_setpoints_that_lead_to_the_ground_disarm_there() -> None:
    """A descent by velocity ends on the ground with the motors off."""
    flight = Flight().hovering()
    flight.vehicle.send(VelocitySetpoint(np.array([0.0, 0.0, -0.5])))
    assert not flight.until(VehicleMode.GROUNDED).armed


def test_hold_brakes_and_stays() -> None:
    """From full speed it stops within its braking distance and then keeps its place."""
    flight = Flight(wind=(2.0, 0.0, 0.0), gust=0.3).hovering()
    flight.vehicle.send(VelocitySetpoint(np.array([4.0, 0.0, 0.0])))
    flight.fly(4.0)
    flight.vehicle.hold()
    held = flight.fly(5.0).odometry.position
    assert np.linalg.norm(flight.fly(5.0).odometry.position - held) < 0.15


def test_unknown_settings_are_told_with_the_known_ones() -> None:
    """A typing mistake in the environment file names the robot, the key and the choices."""
    with pytest.raises(ConfigError, match=r"drone.*wieght.*mass"):
        Flight({"wieght": 2.0})
