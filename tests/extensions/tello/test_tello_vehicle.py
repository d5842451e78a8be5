"""The driver flies an emulated Tello, over a good link and over a bad one."""

from __future__ import annotations

import socket
import time

import numpy as np
import pytest
from tello_flights import Pair, flight, free_port, robot_of
from waiting import until

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.loading import load_vehicle
from aerodaas.errors import ConfigError, VehicleError
from aerodaas.extensions.tello.vehicle import TelloVehicle
from aerodaas.geometry.frames import Vector
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VelocitySetpoint,
)
from tools.tello_vehicle import EmulatedTello, Impairment, TelloOptions

pytestmark = pytest.mark.wall_clock

BAD_AIR = Impairment(loss=0.1, duplicates=0.1, late=0.05, delay=0.01, jitter=0.03, garbled=0.05)


def _send(pair: Pair, setpoint: Setpoint, duration: float) -> None:
    """Send at 20 Hz, as the drone's actor does."""
    for _ in range(round(duration / 0.05)):
        pair.vehicle.send(setpoint)
        time.sleep(0.05)


def _fly_to(pair: Pair, place: Vector, yaw: float | None = None) -> float:
    """Fly until the driver believes to be there; the true distance left."""
    for _ in range(200):
        pair.vehicle.send(PositionSetpoint(place, yaw, 0.8))
        time.sleep(0.05)
        odometry = pair.vehicle.read().odometry
        faces = yaw is None or abs(odometry.yaw - yaw) < 0.1
        if float(np.linalg.norm(odometry.position - place)) < 0.15 and faces:
            return float(np.linalg.norm(pair.tello.truth.position - place))
    pytest.fail("never arrived")


@pytest.mark.slow
def test_a_whole_flight() -> None:
    """Up, to places in ENU whatever the Tello's own axes, a velocity, and down."""
    options = TelloOptions(start=(1.0, 2.0, 0.0), start_yaw=90.0, switched_on_yaw=40.0)
    with flight(options, start=(1, 2, 0), start_yaw=90.0) as pair:
        vehicle, tello = pair.vehicle, pair.tello
        state = vehicle.read()
        assert state.mode is VehicleMode.GROUNDED
        assert not state.armed
        assert state.battery.fraction == pytest.approx(0.9)
        assert state.extra["temperature"] == 60.0
        np.testing.assert_allclose(state.odometry.position, [1, 2, 0])
        assert vehicle.preflight() == []

        state = pair.take_off(1.4)
        assert state.armed
        assert tello.truth.position[2] == pytest.approx(1.4, abs=0.3)
        assert vehicle.preflight() == ["already holding"]

        assert _fly_to(pair, np.array([2.0, 2.5, 1.4]), yaw=0.0) < 0.4
        assert vehicle.read().mode is VehicleMode.GUIDED
        assert tello.truth.yaw == pytest.approx(0.0, abs=0.2)

        _send(pair, VelocitySetpoint(np.zeros(3)), 1.0)
        before = tello.truth.position
        sent = vehicle.send(VelocitySetpoint(np.array([0.0, 0.5, 0.0])))
        assert isinstance(sent, VelocitySetpoint)
        np.testing.assert_allclose(sent.velocity, [0.0, 0.5, 0.0])
        _send(pair, sent, 1.5)
        way = tello.truth.position - before
        assert way[1] > 0.3, "north, although it looks east"
        assert abs(way[0]) < 0.15

        vehicle.hold()
        assert vehicle.read().mode is VehicleMode.HOLDING
        vehicle.land()
        assert vehicle.read().mode is VehicleMode.LANDING
        with pytest.raises(VehicleError, match="while it is landing"):
            vehicle.send(VelocitySetpoint(np.zeros(3)))
        state = pair.until(VehicleMode.GROUNDED)
        assert not state.armed
        assert tello.mode is VehicleMode.GROUNDED
        moves = {"up", "down", "left", "right", "forward", "back", "go", "cw", "ccw", "curve"}
        assert not moves & {text.split()[0] for _, text in tello.heard}


@pytest.mark.slow
def test_it_flies_over_bad_air() -> None:
    """Lost, late, doubled and garbled packets both ways: it arrives, and counts what happened."""
    options = TelloOptions(seed=5, commands=BAD_AIR, replies=BAD_AIR, states=BAD_AIR)
    with flight(options) as pair:
        pair.vehicle.take_off(1.0)
        deadline = time.monotonic() + 40.0
        while pair.vehicle.read().mode is not VehicleMode.HOLDING:
            # The drone's actor asks again where a request was lost.
            if pair.vehicle.read().mode is VehicleMode.GROUNDED:
                pair.vehicle.take_off(1.0)
            assert time.monotonic() < deadline
            time.sleep(0.1)
        assert _fly_to(pair, np.array([1.0, -0.8, 1.2])) < 0.6
        pair.vehicle.land()
        state = pair.until(VehicleMode.GROUNDED, 40.0)
        assert state.extra["malformed_packets"] > 0


def test_nobody_there_is_said_in_time() -> None:
    """Connecting ends when it should, with what to look at."""
    robot = robot_of(free_port())
    vehicle = TelloVehicle(robot, EnvironmentConfig(robots=[robot]))
    began = time.monotonic()
    with pytest.raises(VehicleError, match=r"no answer from 127.0.0.1.*Wi-Fi"):
        vehicle.connect(timeout=1.0)
    assert time.monotonic() - began < 5.0


def test_no_state_packets_is_told_apart_from_no_answer() -> None:
    """The usual firewall: replies come, state packets do not."""
    options = TelloOptions(states=Impairment(loss=1.0))
    with pytest.raises(VehicleError, match=r"answers but no state packet.*firewall"):
        _connect(options)


def test_ports_need_sdk_3() -> None:
    """An older Tello cannot send elsewhere, and says so."""
    with pytest.raises(VehicleError, match=r"needs SDK 3.0, and it has version 20"):
        _connect(TelloOptions(sdk=20))


def _connect(options: TelloOptions) -> None:
    with EmulatedTello(options) as tello:
        robot = robot_of(tello.port)
        vehicle = TelloVehicle(robot, EnvironmentConfig(robots=[robot]))
        vehicle.connect(timeout=2.0)


def test_a_port_that_is_taken_is_named() -> None:
    """The commonest reason for no state packets: another program has the port."""
    port = free_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", port))
        robot = robot_of(9, state_port=port)
        vehicle = TelloVehicle(robot, EnvironmentConfig(robots=[robot]))
        with pytest.raises(VehicleError, match=f"port {port} is taken"):
            vehicle.connect()
    robot = robot_of(9, interface="nonesuch0")
    with pytest.raises(VehicleError, match="no network interface is called 'nonesuch0'"):
        TelloVehicle(robot, EnvironmentConfig(robots=[robot])).connect()
    robot = robot_of(9, local_address="203.0.113.7")
    with pytest.raises(VehicleError, match=r"203.0.113.7 is no address of this host"):
        TelloVehicle(robot, EnvironmentConfig(robots=[robot])).connect()


@pytest.mark.slow
def test_two_tellos_on_one_host_with_the_default_ports() -> None:
    """SDK 2.0 in station mode: one address of this host for each."""
    with (
        EmulatedTello(TelloOptions("127.0.0.21", sdk=20, battery=0.5)) as one,
        EmulatedTello(TelloOptions("127.0.0.22", sdk=20, battery=0.7)) as other,
    ):
        charges = []
        vehicles = []
        for tello, own in ((one, "127.0.0.31"), (other, "127.0.0.32")):
            robot = robot_of(
                tello.port,
                address=tello.options.address,
                local_address=own,
                state_port=8890,
            )
            vehicles.append(TelloVehicle(robot, EnvironmentConfig(robots=[robot])))
            vehicles[-1].connect()
        charges = [vehicle.read().battery.fraction for vehicle in vehicles]
        vehicles[0].take_off(1.0)
        until(lambda: vehicles[0].read().mode is VehicleMode.HOLDING)
        assert one.mode is not VehicleMode.GROUNDED
        assert other.mode is VehicleMode.GROUNDED
        for vehicle in vehicles:
            vehicle.close()
    assert charges == [0.5, 0.7]


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"adress": "10.0.0.1"}, "adress"),
        ({"full_speed": 0}, "full_speed"),
        ({"state_port": 70000}, "state_port"),
    ],
)
def test_settings_are_checked_by_name(settings: dict[str, object], complaint: str) -> None:
    """A misspelt setting is refused with the ones that exist."""
    robot = RobotConfig(id="t", driver="tello", settings=settings)
    with pytest.raises(ConfigError, match=f"robot t: settings: {complaint}"):
        TelloVehicle(robot, EnvironmentConfig(robots=[robot]))


def test_a_tello_that_somebody_flies_is_left_in_the_air() -> None:
    """No connection that only looks lands it or commands it."""
    with EmulatedTello() as tello:
        robot = robot_of(tello.port)
        config = EnvironmentConfig(robots=[robot])
        pilot = load_vehicle(robot, config)
        pilot.connect()
        pilot.take_off(1.0)
        until(lambda: pilot.read().mode is VehicleMode.HOLDING)
        vehicle = load_vehicle(robot_of(tello.port), config, observing=True)
        vehicle.connect()
        until(lambda: vehicle.read().armed)
        with pytest.raises(VehicleError, match="only looked at"):
            vehicle.hold()
        with pytest.raises(VehicleError, match="only looked at"):
            vehicle.land()
        vehicle.close()
        assert "land" not in {text for _, text in tello.heard}
        pilot.close()
        until(lambda: "land" in {text for _, text in tello.heard})  # a datagram, on its way


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
