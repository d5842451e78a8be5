"""The driver flies emulated PX4 and ArduCopter, over good links and bad ones."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from mavlink_flights import LOOPBACK, flight, free_port, robot_of, wait_for

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.clock import ScaledClock
from aerodaas.types.errors import ConfigError, InvalidWaypointError, VehicleError
from aerodaas.types.vehicle import (
    ClockedVehicle,
    PositionSetpoint,
    Vehicle,
    VehicleMode,
    VelocitySetpoint,
)
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot, Impairment

pytestmark = pytest.mark.wall_clock

FAMILIES = ("px4", "ardupilot")
BAD_AIR = Impairment(loss=0.3, duplicates=0.1, late=0.05, lateness=0.3, delay=0.01, jitter=0.03)


def vehicle_at(port: int, **settings: object) -> MavlinkVehicle:
    """A driver that is not connected yet."""
    robot = robot_of(port, **settings)
    return MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))


def test_it_is_a_vehicle_with_honest_capabilities() -> None:
    """What it offers can be asked before anything is connected."""
    vehicle = vehicle_at(1)
    assert isinstance(vehicle, Vehicle)
    assert isinstance(vehicle, ClockedVehicle)
    assert vehicle.capabilities.returns_home
    assert vehicle.preflight() == ["not connected"]
    with pytest.raises(VehicleError, match="not connected"):
        vehicle.read()


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_a_whole_flight(family: str) -> None:
    """Up, to a place in ENU wherever its own frame begins, a velocity, and down."""
    options = AutopilotOptions(
        family=family,  # type: ignore[arg-type]
        start=(1.0, 2.0, 0.0),
        start_yaw=90.0,
        estimator_origin=(30.0, -20.0, 4.0),
    )
    with flight(options, start=(1.0, 2.0, 0.0)) as pair:
        vehicle = pair.vehicle
        vehicle.use_clock(ScaledClock())
        state = vehicle.read()
        assert state.odometry.position == pytest.approx([1.0, 2.0, 0.0], abs=0.05)
        assert state.odometry.yaw == pytest.approx(math.pi / 2, abs=0.02)
        assert state.battery.fraction == pytest.approx(0.9, abs=0.02)
        assert vehicle.preflight() == []
        risen = pair.take_off(2.0)
        assert risen.odometry.height == pytest.approx(2.0, abs=0.3)
        assert pair.fly_to(np.array([4.0, 5.0, 3.0]), yaw=-1.0) < 0.3
        state = vehicle.read()
        assert state.mode is VehicleMode.GUIDED
        assert state.gps is not None
        assert state.gps.latitude == pytest.approx(47.397742 + 5.0 / 111_200, abs=1e-5)
        sent = VelocitySetpoint(np.array([1.0, 0.0, 0.0]), 0.3)
        pair.stream(sent, 2.0)
        moving = pair.autopilot.truth
        assert moving.velocity == pytest.approx([1.0, 0.0, 0.0], abs=0.15)
        assert moving.yaw_rate == pytest.approx(0.3, abs=0.1)
        vehicle.land()
        landed = pair.until(VehicleMode.GROUNDED)
        assert not landed.armed
        assert abs(landed.odometry.height) < 0.1
        assert pair.autopilot.firmware.motions == ["arm", "take off", "follow", "land"]
        vehicle.close()
        with pytest.raises(VehicleError, match="not connected"):
            vehicle.read()


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_a_whole_flight_over_a_bad_link(family: str) -> None:
    """With 30 % loss, doubled, late and overtaking packets it still arms and takes off once."""
    options = AutopilotOptions(
        family=family,  # type: ignore[arg-type]
        uplink=BAD_AIR,
        downlink=BAD_AIR,
    )
    with flight(options) as pair:
        pair.take_off(2.0)
        assert pair.fly_to(np.array([3.0, 1.0, 2.5])) < 0.5
        pair.vehicle.land()
        pair.until(VehicleMode.GROUNDED)
        motions = pair.autopilot.firmware.motions
    assert motions.count("arm") == 1
    assert motions.count("take off") == 1


@pytest.mark.slow
def test_the_speed_asked_for_is_kept() -> None:
    """Neither autopilot takes a speed with a place, so the target itself moves at it."""
    with flight(AutopilotOptions(family="px4")) as pair:
        pair.guide()
        far = np.array([12.0, 0.0, 2.0])
        fastest = 0.0
        for _ in range(80):
            pair.vehicle.send(PositionSetpoint(far, None, 1.0))
            time.sleep(0.05)
            fastest = max(fastest, float(np.linalg.norm(pair.autopilot.truth.velocity[:2])))
        assert 0.8 < fastest < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_sent_is_clipped_and_said(family: str) -> None:
    """`send` returns the setpoint as it went out."""
    with flight(AutopilotOptions(family=family)) as pair:  # type: ignore[arg-type]
        pair.guide()
        fast = pair.vehicle.send(VelocitySetpoint(np.array([30.0, 40.0, 9.0]), 9.0))
        assert isinstance(fast, VelocitySetpoint)
        assert fast.velocity == pytest.approx([2.4, 3.2, 1.5])
        assert fast.yaw_rate == pytest.approx(math.pi / 2)
        place = pair.vehicle.send(PositionSetpoint(np.array([1.0, 2.0, 3.0]), None, 99.0))
        assert isinstance(place, PositionSetpoint)
        assert place.speed == 4.0
        with pytest.raises(InvalidWaypointError, match="finite"):
            pair.vehicle.send(VelocitySetpoint(np.array([math.nan, 0.0, 0.0])))


def test_nothing_is_flown_from_the_ground() -> None:
    """Without a take-off, no setpoint leaves, and no mode is asked for."""
    with flight() as pair:
        for deed in (
            lambda: pair.vehicle.send(VelocitySetpoint(np.zeros(3))),
            pair.vehicle.hold,
            pair.vehicle.return_home,
        ):
            with pytest.raises(VehicleError, match="on the ground"):
                deed()
        pair.vehicle.land()
        with pytest.raises(InvalidWaypointError, match="positive"):
            pair.vehicle.take_off(-1.0)
        assert pair.heard("SET_POSITION_TARGET_LOCAL_NED") == []
        assert pair.commands(mavlink.MAV_CMD_DO_SET_MODE) == 0


@pytest.mark.slow
def test_setpoints_come_before_the_mode() -> None:
    """PX4 is asked for offboard only after more than a second of setpoints."""
    with flight(AutopilotOptions(family="px4")) as pair:
        pair.guide()
        asked = [
            stamp
            for stamp, one in pair.autopilot.heard
            if one.get_type() == "COMMAND_LONG"
            and one.command == mavlink.MAV_CMD_DO_SET_MODE
            and one.param2 == 6
        ]
        streamed = [
            stamp
            for stamp, one in pair.autopilot.heard
            if one.get_type() == "SET_POSITION_TARGET_LOCAL_NED" and stamp < asked[0]
        ]
        assert len(streamed) >= 15
        assert asked[0] - streamed[0] > 1.0
        assert len(asked) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "words"),
    [("px4", "estimator: position not stable"), ("ardupilot", "PreArm: Need Position Estimate")],
)
def test_a_refusal_comes_with_its_reason(family: str, words: str) -> None:
    """The arming checks' own words: events of PX4, STATUSTEXT of ArduPilot."""
    port = free_port()
    options = AutopilotOptions(
        family=family,  # type: ignore[arg-type]
        peer=(LOOPBACK, port),
        ready_after=1e6,
    )
    with EmulatedAutopilot(options):
        vehicle = vehicle_at(port, ready_timeout=5.0)
        with pytest.raises(VehicleError, match=f"position within 5 s.*{words}"):
            vehicle.connect()


def test_nobody_there() -> None:
    """Connecting ends in its time and says what was heard."""
    with pytest.raises(VehicleError, match="no HEARTBEAT on udpin"):
        vehicle_at(free_port()).connect(0.5)
    with pytest.raises(VehicleError, match="no program listens there"):
        vehicle_at(1, url=f"tcp:{LOOPBACK}:1").connect(0.5)
    with pytest.raises(VehicleError, match="no such device"):
        vehicle_at(1, url="serial:/dev/nothing:57600").connect(0.5)
    with pytest.raises(ConfigError, match="no address"):
        vehicle_at(1, url="bluetooth:7").connect(0.5)


def test_a_taken_port_is_named() -> None:
    """Another program at our port is what users meet first."""
    with flight() as pair:
        port = int(pair.robot.settings["url"].rpartition(":")[2])
        with pytest.raises(VehicleError, match=f"port {port} is taken"):
            vehicle_at(port).connect(0.5)


@pytest.mark.parametrize(
    ("options", "settings", "words"),
    [
        (AutopilotOptions(vehicle_type=10), {}, "system 1: a ground rover"),
        (AutopilotOptions(system=3), {"system": 7}, 'system 3: a quadrotor.*"system" is set to 7'),
        (AutopilotOptions(key=b"k" * 32), {"signing_key": "KEY"}, "none that can be read"),
    ],
)
def test_others_are_not_flown(
    options: AutopilotOptions,
    settings: dict[str, object],
    words: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """A rover, another system, or one with another key: named in the error, never commanded."""
    if "signing_key" in settings:
        path = tmp_path_factory.mktemp("keys") / "key"
        path.write_bytes(b"x" * 32)
        settings = {"signing_key": str(path)}
    port = free_port()
    changed = AutopilotOptions(**{**options.__dict__, "peer": (LOOPBACK, port)})
    with EmulatedAutopilot(changed) as autopilot:
        with pytest.raises(VehicleError, match=words):
            vehicle_at(port, **settings).connect(2.0)
        kinds = {message.get_type() for _, message in autopilot.heard}
        assert kinds <= {"HEARTBEAT"}


@pytest.mark.slow
def test_two_vehicles_on_one_port_are_told_apart() -> None:
    """Each system id has its own driver's ear; a second driver hears through the first."""
    first, second = free_port(), free_port()
    one = AutopilotOptions(system=1, peer=(LOOPBACK, first))
    two = AutopilotOptions(system=2, peer=(LOOPBACK, first), family="ardupilot", battery=0.5)
    with EmulatedAutopilot(one) as left, EmulatedAutopilot(two) as right:
        a = vehicle_at(first, system=1, forward=f"udpout:{LOOPBACK}:{second}")
        b = vehicle_at(second, system=2)
        a.connect()
        b.connect()
        assert a.read().battery.fraction == pytest.approx(0.9, abs=0.02)
        assert b.read().battery.fraction == pytest.approx(0.5, abs=0.02)
        b.take_off(2.0)
        wait_for(lambda: b.read().odometry.height > 1.0)
        assert right.armed
        assert not left.armed
        b.close()
        a.close()


def test_signed_flight(tmp_path_factory: pytest.TempPathFactory) -> None:
    """With the key on both sides it flies, and what is not signed is not believed."""
    key = bytes(range(32))
    path = tmp_path_factory.mktemp("keys") / "key.hex"
    path.write_text(key.hex())
    with flight(AutopilotOptions(key=key), signing_key=str(path)) as pair:
        forged = mavlink.MAVLink(None, 1, 1)
        message = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 9000, 0, 3, 0, 0, 0, 0, 0, 0)
        pair.autopilot.inject(message.pack(forged))
        time.sleep(0.3)
        assert pair.vehicle.read().battery.fraction > 0.8
        pair.take_off(2.0)
        assert pair.autopilot.armed


def test_a_bad_key_is_refused_without_being_shown(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The message names the place, and none of the key."""
    path = tmp_path_factory.mktemp("keys") / "short"
    path.write_text("deadbeef")
    with pytest.raises(ConfigError, match="64 hexadecimal digits") as caught:
        vehicle_at(1, signing_key=str(path)).connect(0.1)
    assert "deadbeef" not in str(caught.value)


@pytest.mark.parametrize("family", FAMILIES)
def test_unsafe_failsafes_are_reported_or_set(
    family: str, caplog: pytest.LogCaptureFixture
) -> None:
    """With the value that would be safer; set only when asked to."""
    name = "COM_LOW_BAT_ACT" if family == "px4" else "BATT_FS_LOW_ACT"
    safe = 3.0 if family == "px4" else 2.0
    options = AutopilotOptions(family=family)  # type: ignore[arg-type]
    with flight(options) as pair:
        assert f"{name} is 0" in caplog.text
        assert pair.autopilot.firmware.parameters.values[name] == 0.0
        assert "would not come home if this process died" in caplog.text
    with flight(options, failsafes="set") as pair:
        assert pair.autopilot.firmware.parameters.values[name] == safe
        assert pair.vehicle.parameters.get("NO_SUCH_THING") is None
        with pytest.raises(VehicleError, match="knows no parameter"):
            pair.vehicle.parameters.set("NO_SUCH_THING", 1.0)


@pytest.mark.parametrize("role", ["companion", "ground_station"])
def test_a_ground_station_has_px4_come_home_when_setpoints_stop(role: str) -> None:
    """It holds first as a ground station's, and returns as a companion's; afterwards as before."""
    with flight(AutopilotOptions(family="px4"), fallback="set", role=role) as pair:
        values = pair.autopilot.firmware.parameters.values
        assert values["COM_OBL_RC_ACT"] == (5.0 if role == "ground_station" else 3.0)
        assert values["NAV_DLL_ACT"] == (2.0 if role == "ground_station" else 0.0)
    assert (values["COM_OBL_RC_ACT"], values["NAV_DLL_ACT"]) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"adress": "x"}, "adress"),
        ({"system": 0}, "system"),
        ({"fence": "stop"}, "fence"),
        ({"ready_timeout": -1}, "ready_timeout"),
    ],
)
def test_settings_are_checked_by_name(settings: dict[str, object], complaint: str) -> None:
    """A misspelt setting is refused with the ones that exist."""
    robot = RobotConfig(id="m", driver="mavlink", settings=settings)
    with pytest.raises(ConfigError, match=f"robot m: settings: {complaint}"):
        MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))


def test_a_camera_without_a_stream_is_none() -> None:
    """MAVLink has no pictures of its own, so that such a camera can only be left out."""
    sensors = [{"id": "bare"}, {"id": "rtsp", "settings": {"path": "rtsp://10.0.0.2/eye"}}]
    robot = RobotConfig.model_validate({"id": "m", "driver": "mavlink", "sensors": sensors})
    environment = EnvironmentConfig(robots=[robot])
    assert [environment.has_pictures(sensor) for sensor in robot.sensors] == [False, True]
    simulated = EnvironmentConfig(robots=[robot.model_copy(update={"driver": "simulated"})])
    assert all(simulated.has_pictures(sensor) for sensor in robot.sensors)


def test_home_frame_needs_a_home() -> None:
    """Said when the vehicle is built, not in flight."""
    with pytest.raises(ConfigError, match="needs a home"):
        vehicle_at(1, frame="home")
