"""The driver flies an emulated Tello, over a good link and over a bad one."""

from __future__ import annotations

import math
import socket
import time

import numpy as np
import pytest
from tello_flights import LOOPBACK, Pair, flight, free_port, robot_of, wait_for

from aerodaas.clock import ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.loading import load_vehicle
from aerodaas.errors import ConfigError, InvalidWaypointError, VehicleError
from aerodaas.extensions.tello.vehicle import TelloVehicle
from aerodaas.geometry.frames import Vector
from aerodaas.messages.vehicle import (
    ClockedVehicle,
    FlightEnd,
    PositionSetpoint,
    Setpoint,
    Vehicle,
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


def test_it_is_a_vehicle_with_honest_capabilities() -> None:
    """What it offers can be asked before anything is connected."""
    robot = RobotConfig(id="t", driver="tello")
    vehicle = TelloVehicle(robot, EnvironmentConfig(robots=[robot]))
    assert isinstance(vehicle, Vehicle)
    assert isinstance(vehicle, ClockedVehicle)
    assert not vehicle.capabilities.global_position
    assert not vehicle.capabilities.returns_home
    assert vehicle.preflight() == ["not connected"]
    with pytest.raises(VehicleError, match="not connected"):
        vehicle.read()


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


def test_setpoints_are_clipped_and_nonsense_is_refused() -> None:
    """What it returns is what it flies; numbers that are none never reach the wire."""
    with flight() as pair:
        with pytest.raises(VehicleError, match="on the ground"):
            pair.vehicle.send(VelocitySetpoint(np.zeros(3)))
        pair.take_off()
        sent = pair.vehicle.send(VelocitySetpoint(np.array([30.0, 40.0, -9.0]), yaw_rate=-9.0))
        assert isinstance(sent, VelocitySetpoint)
        np.testing.assert_allclose(sent.velocity, [0.6, 0.8, -1.0])
        assert sent.yaw_rate == pytest.approx(-math.radians(90))
        pair.vehicle.hold()
        place = pair.vehicle.send(PositionSetpoint(np.array([0.0, 0.0, 1.0]), speed=20.0))
        assert isinstance(place, PositionSetpoint)
        assert place.speed == 1.0
        for bad in (
            VelocitySetpoint(np.array([math.nan, 0.0, 0.0])),
            PositionSetpoint(np.array([0.0, math.inf, 1.0])),
            PositionSetpoint(np.zeros(3), yaw=math.nan),
            PositionSetpoint(np.zeros(3), speed=-1.0),
        ):
            with pytest.raises(InvalidWaypointError):
                pair.vehicle.send(bad)
        wait_for(lambda: pair.said("rc") > 0)
        for _, text in pair.tello.heard:
            if text.startswith("rc"):
                assert all(-100 <= int(word) <= 100 for word in text.split()[1:])


@pytest.mark.slow
def test_when_the_setpoint_loop_stops_it_stops_and_falls_silent() -> None:
    """The sticks are centred, then nothing more is said, so that the Tello lands by itself."""
    with flight() as pair:
        pair.take_off()
        _send(pair, VelocitySetpoint(np.array([0.8, 0.0, 0.0])), 1.0)
        assert pair.tello.truth.velocity[0] > 0.4
        time.sleep(2.5)
        assert abs(pair.tello.truth.velocity[0]) < 0.1
        assert pair.tello.heard[-1][1] == "rc 0 0 0 0"
        assert time.monotonic() - pair.tello.heard[-1][0] > 1.0, "and it is quiet"


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


def test_a_refused_take_off_is_told_with_its_reason() -> None:
    """The Tello says `error Motor stop`; people are told what that means."""
    with flight(TelloOptions(battery=0.08), battery_minimum=0.0) as pair:
        pair.vehicle.take_off(1.0)
        pair.until(VehicleMode.GROUNDED)
        with pytest.raises(VehicleError, match=r"Motor stop.*battery is low"):
            pair.vehicle.take_off(1.0)
    with flight(TelloOptions(battery=0.15)) as pair:
        assert pair.vehicle.preflight() == ["the battery holds 15%, take-off needs 20%"]
        with pytest.raises(VehicleError, match="15%"):
            pair.vehicle.take_off(1.0)
        assert pair.said("takeoff") == 0
    with flight(TelloOptions(temperature=92.0)) as pair:
        assert any("hot" in reason for reason in pair.vehicle.preflight())


@pytest.mark.slow
def test_a_lost_reply_to_take_off_or_landing_does_not_matter() -> None:
    """That it flies or stands shows in its state; neither is said twice in vain."""
    deaf = Impairment(late=1.0, lateness=60.0)
    with EmulatedTello(TelloOptions()) as tello:
        robot = robot_of(tello.port)
        vehicle = TelloVehicle(robot, EnvironmentConfig(robots=[robot]))
        vehicle.connect()
        tello.spoil(replies=deaf)
        pair = Pair(tello, vehicle, robot, EnvironmentConfig(robots=[robot]))
        pair.vehicle.take_off(0.8)
        pair.until(VehicleMode.HOLDING, 25.0)
        assert pair.said("takeoff") == 1
        vehicle.return_home()
        pair.until(VehicleMode.GROUNDED)
        vehicle.close()


@pytest.mark.slow
def test_a_landing_is_asked_for_until_it_descends() -> None:
    """The request is lost, and a stray reply looks like its answer: it lands all the same."""
    with flight() as pair:
        pair.take_off()
        pair.tello.spoil(commands=Impairment(loss=1.0))
        pair.vehicle.land()
        time.sleep(0.2)
        assert pair.tello._client is not None
        pair.tello._transmit(b"ok", pair.tello._client)
        time.sleep(0.3)
        pair.tello.spoil(commands=Impairment())
        pair.until(VehicleMode.GROUNDED)
        assert pair.tello.mode is VehicleMode.GROUNDED


def test_silence_of_the_tello_is_loss_of_the_link() -> None:
    """Without state packets it is lost, its stamp stands still, and nothing is flown blind."""
    with flight() as pair:
        clock = ScaledClock()
        pair.vehicle.use_clock(clock)
        pair.take_off()
        before = pair.vehicle.read()
        assert abs(clock.now() - before.stamp) < 0.3e9
        pair.tello.spoil(states=Impairment(loss=1.0))
        time.sleep(0.8)
        sent = pair.vehicle.send(PositionSetpoint(np.array([9.0, 0.0, 1.0])))
        assert isinstance(sent, VelocitySetpoint)
        assert not sent.velocity.any()
        state = pair.until(VehicleMode.LOST)
        assert "no state packet" in state.faults[0]
        time.sleep(0.5)
        assert pair.vehicle.read().stamp == pytest.approx(state.stamp, abs=0.1e9)
        pair.tello.spoil(states=Impairment())
        pair.until(VehicleMode.HOLDING)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("capacity", "battery", "ended", "words"),
    [
        (0.05, 0.12, FlightEnd.LANDED, "landed by itself"),
        # It holds too little for its own landing.
        (0.01, 0.3, FlightEnd.FELL, "motors have stopped in flight"),
    ],
)
def test_a_tello_that_comes_down_by_itself_is_left_alone(
    capacity: float, battery: float, ended: FlightEnd, words: str
) -> None:
    """Nobody asked for it: its own protection has taken over, or its battery is empty."""
    with flight(TelloOptions(battery=battery, capacity=capacity), battery_minimum=0.0) as pair:
        pair.take_off()
        state = pair.until(VehicleMode.FAILSAFE, 30.0)
        assert state.ended is ended
        with pytest.raises(VehicleError, match=words):
            pair.vehicle.send(VelocitySetpoint(np.zeros(3)))


@pytest.mark.slow
def test_close_lands_a_flying_tello_and_frees_the_ports() -> None:
    """Letting go leaves it safe, and the next driver can connect."""
    with flight() as pair:
        pair.take_off()
        pair.vehicle.close()
        wait_for(lambda: pair.tello.mode is VehicleMode.GROUNDED)
        pair.vehicle.connect()
        assert pair.vehicle.read().mode is VehicleMode.GROUNDED


def test_packets_from_strangers_are_counted_and_ignored() -> None:
    """Somebody else's state packets and replies change nothing."""
    with flight() as pair, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.9", 0))
        before = pair.vehicle.read().battery
        for _ in range(20):
            stranger.sendto(b"bat:1;", (LOOPBACK, pair.robot.settings["state_port"]))
        wait_for(lambda: pair.vehicle.read().extra["foreign_packets"] >= 20)
        assert pair.vehicle.read().battery == before


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


def test_garbage_instead_of_state_is_told() -> None:
    """Packets come that are none of a Tello's."""
    options = TelloOptions(states=Impairment(garbled=1.0))
    with pytest.raises(VehicleError, match="none of which is a state packet"):
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
        wait_for(lambda: vehicles[0].read().mode is VehicleMode.HOLDING)
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
        wait_for(lambda: pilot.read().mode is VehicleMode.HOLDING)
        vehicle = load_vehicle(robot_of(tello.port), config, observing=True)
        vehicle.connect()
        wait_for(lambda: vehicle.read().armed)
        with pytest.raises(VehicleError, match="only looked at"):
            vehicle.hold()
        with pytest.raises(VehicleError, match="only looked at"):
            vehicle.land()
        vehicle.close()
        assert "land" not in {text for _, text in tello.heard}
        pilot.close()
        wait_for(lambda: "land" in {text for _, text in tello.heard})  # a datagram, on its way
