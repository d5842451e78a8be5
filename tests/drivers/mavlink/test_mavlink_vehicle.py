"""The driver flies emulated PX4 and ArduCopter, over good links and bad ones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from autopilot import Family, robot_of
from emulated import FAMILIES, LOOPBACK, Stepped, free_port

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.errors import ConfigError, VehicleError
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    VehicleMode,
    VelocitySetpoint,
)
from tools.mavlink_vehicle import AutopilotOptions, Impairment

LOSSY = Impairment(loss=0.2, delay=0.1)
BAD_AIR = Impairment(loss=0.3, duplicates=0.1, late=0.05, lateness=0.3, delay=0.01, jitter=0.03)


def vehicle_at(port: int, **settings: object) -> MavlinkVehicle:
    """A driver that is not connected yet."""
    robot = robot_of(port, **settings)
    return MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))


@pytest.mark.parametrize("family", FAMILIES)
def test_a_whole_flight(monkeypatch: pytest.MonkeyPatch, family: Family) -> None:
    """Up, to a place in ENU wherever its own frame begins, a velocity, and down."""
    options = AutopilotOptions(
        family=family,
        start=(1.0, 2.0, 0.0),
        start_yaw=90.0,
        estimator_origin=(30.0, -20.0, 4.0),
    )
    with Stepped(monkeypatch, options, start=(1.0, 2.0, 0.0)) as ends:
        ends.wait(lambda: not ends.vehicle.preflight())
        state = ends.vehicle.read()
        assert state.odometry.position == pytest.approx([1.0, 2.0, 0.0], abs=0.05)
        assert state.odometry.yaw == pytest.approx(math.pi / 2, abs=0.02)
        assert state.battery.fraction == pytest.approx(0.9, abs=0.02)
        assert ends.take_off(2.0).odometry.height == pytest.approx(2.0, abs=0.3)
        assert ends.fly_to(np.array([4.0, 5.0, 3.0]), yaw=-1.0) < 0.3
        state = ends.vehicle.read()
        assert state.mode is VehicleMode.GUIDED
        assert state.gps is not None
        assert state.gps.latitude == pytest.approx(47.397742 + 5.0 / 111_200, abs=1e-5)
        ends.stream(VelocitySetpoint(np.array([1.0, 0.0, 0.0]), 0.3), 2.0)
        moving = ends.autopilot.truth
        assert moving.velocity == pytest.approx([1.0, 0.0, 0.0], abs=0.15)
        assert moving.yaw_rate == pytest.approx(0.3, abs=0.1)
        ends.vehicle.land()
        landed = ends.until(VehicleMode.GROUNDED)
        assert not landed.armed
        assert abs(landed.odometry.height) < 0.1
        assert ends.firmware.motions == ["arm", "take off", "follow", "land"]


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("link", "seed"), [(BAD_AIR, 0), (LOSSY, 0), (LOSSY, 1), (LOSSY, 2)])
def test_a_bad_link_costs_no_flight(
    monkeypatch: pytest.MonkeyPatch, family: Family, link: Impairment, seed: int
) -> None:
    """With lost, doubled, late and overtaking packets it arms and takes off once."""
    options = AutopilotOptions(family=family, seed=seed, uplink=link, downlink=link)
    with Stepped(monkeypatch, options) as ends:
        assert ends.take_off(2.0).odometry.height == pytest.approx(2.0, abs=0.3)
        assert ends.fly_to(np.array([3.0, 1.0, 2.5])) < 0.5
        while ends.turn().mode is not VehicleMode.GROUNDED:
            ends.vehicle.land()
        motions = ends.firmware.motions
    assert motions.count("arm") == 1
    assert motions.count("take off") == 1


def test_nobody_there() -> None:
    """Connecting ends in its time and says what was heard."""
    for url, kind, words in (
        (f"udpin:{LOOPBACK}:{free_port()}", VehicleError, "no HEARTBEAT on udpin"),
        (f"tcp:{LOOPBACK}:1", VehicleError, "no program listens there"),
        ("serial:/dev/nothing:57600", VehicleError, "no such device"),
        ("bluetooth:7", ConfigError, "no address"),
    ):
        with pytest.raises(kind, match=words):
            vehicle_at(1, url=url).connect(0.1)


@pytest.mark.parametrize(
    ("options", "settings", "words"),
    [
        (AutopilotOptions(vehicle_type=10), {}, "system 1: a ground rover"),
        (AutopilotOptions(system=3), {"system": 7}, 'system 3: a quadrotor.*"system" is set to 7'),
        (AutopilotOptions(key=b"k" * 32), {"signing_key": "key"}, "none that can be read"),
    ],
)
def test_others_are_not_flown(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    options: AutopilotOptions,
    settings: dict[str, Any],
    words: str,
) -> None:
    """A rover, another system, or one with another key: named in the error, never commanded."""
    (tmp_path / "key").write_bytes(b"x" * 32)
    monkeypatch.chdir(tmp_path)
    ends = Stepped(monkeypatch, options, **settings)
    with pytest.raises(VehicleError, match=words):
        ends.vehicle.connect(2.0)
    assert {message.get_type() for _, message in ends.autopilot.heard} <= {"HEARTBEAT"}
    ends.autopilot.stop()


@pytest.mark.parametrize("family", FAMILIES)
def test_unsafe_failsafes_are_reported_or_set(
    monkeypatch: pytest.MonkeyPatch, family: Family, caplog: pytest.LogCaptureFixture
) -> None:
    """With the value that would be safer; set only when asked to."""
    name, safe = {"px4": ("COM_LOW_BAT_ACT", 3.0), "ardupilot": ("BATT_FS_LOW_ACT", 2.0)}[family]
    options = AutopilotOptions(family=family)
    with Stepped(monkeypatch, options, failsafes="report", fallback="report") as ends:
        assert f"{name} is 0" in caplog.text
        assert ends.firmware.parameters.values[name] == 0.0
        assert "would not come home if this process died" in caplog.text
    with Stepped(monkeypatch, options, failsafes="set") as ends:
        assert ends.firmware.parameters.values[name] == safe


@pytest.mark.parametrize(("role", "first", "lost"), [("companion", 3, 0), ("ground_station", 5, 2)])
def test_a_ground_station_has_px4_come_home_when_setpoints_stop(
    monkeypatch: pytest.MonkeyPatch, role: str, first: float, lost: float
) -> None:
    """It holds first as a ground station's, and returns as a companion's; afterwards as before."""
    with Stepped(monkeypatch, fallback="set", role=role) as ends:
        values = ends.firmware.parameters.values
        assert (values["COM_OBL_RC_ACT"], values["NAV_DLL_ACT"]) == (first, lost)
    assert (values["COM_OBL_RC_ACT"], values["NAV_DLL_ACT"]) == (0.0, 0.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_reconnecting_in_flight_takes_off_no_second_time(
    monkeypatch: pytest.MonkeyPatch, family: Family
) -> None:
    """A new driver finds the vehicle in the air, knows where it took off, and flies on."""
    options = AutopilotOptions(
        family=family,
        parameters={"COM_OBL_RC_ACT": 5.0} if family == "px4" else {},
        estimator_origin=(7.0, 8.0, 9.0),
    )
    with Stepped(monkeypatch, options) as ends:
        ends.guide()
        there = np.array([3.0, 0.0, 2.0])
        ends.fly_to(there)
        ends.stream(PositionSetpoint(there), 1.5)
        ends.die()
        with ends.again() as vehicle:
            ends.advance(0.1)
            state = vehicle.read()
            assert state.armed
            assert state.odometry.position == pytest.approx([3.0, 0.0, 2.0], abs=0.6)
            with pytest.raises(VehicleError, match="already"):
                vehicle.take_off(2.0)
            assert ends.firmware.motions.count("take off") == 1
            vehicle.land()
            for _ in range(300):
                ends.advance(0.05)
                vehicle.read()
            assert not ends.autopilot.armed


@pytest.mark.parametrize("family", FAMILIES)
def test_an_uploaded_fence_is_enforced(monkeypatch: pytest.MonkeyPatch, family: Family) -> None:
    """Uploaded with its action: crossing it, the vehicle protects itself, and we are told."""
    limits = {"geofence": {"polygon": [[-4, -4], [4, -4], [4, 4], [-4, 4]], "ceiling": 20}}
    options = AutopilotOptions(family=family)
    with Stepped(monkeypatch, options, fence="return", limits=limits) as ends:
        ends.guide()
        with pytest.raises(VehicleError, match="flies it"):
            ends.stream(VelocitySetpoint(np.array([2.0, 0.0, 0.0])), 8.0)
        assert 3.0 < float(ends.autopilot.truth.position[0]) < 9.0
        ends.until(VehicleMode.FAILSAFE, timeout=3.0)
        assert ends.autopilot.mode in {VehicleMode.RETURNING, VehicleMode.LANDING}


def test_a_target_left_alone_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed on the way to a far place, the vehicle stops within metres, not at the place."""
    with Stepped(monkeypatch, AutopilotOptions(family="ardupilot")) as ends:
        ends.guide()
        ends.stream(PositionSetpoint(np.array([100.0, 0.0, 2.0]), None, 2.0), 3.0)
        ends.die()
        there = float(ends.autopilot.truth.position[0])
        ends.advance(6.0)
        assert float(ends.autopilot.truth.position[0]) < there + 10.0
        assert float(np.linalg.norm(ends.autopilot.truth.velocity)) < 0.2


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    ("link", "step"),
    [
        (Impairment(), 20),
        pytest.param(Impairment(delay=0.1, jitter=0.1), 4, marks=pytest.mark.slow),
        pytest.param(LOSSY, 4, marks=pytest.mark.slow),
    ],
)
def test_a_take_off_called_off_starts_no_motors_after_the_ground_is_told(
    monkeypatch: pytest.MonkeyPatch, family: Family, link: Impairment, step: int
) -> None:
    """Called off after 0 to 3 s: landed where it flew, and still for good once it says grounded."""
    options = AutopilotOptions(family=family, uplink=link, downlink=link)
    flown = 0
    with Stepped(monkeypatch, options) as ends:
        firmware = ends.firmware
        for hundredths in (*range(0, 100, step), 150, 200, 250, 300):
            firmware.motions.clear()
            ends.vehicle.take_off(2.0)
            ends.advance(hundredths / 100)
            ends.vehicle.land()
            state = ends.until(VehicleMode.GROUNDED)
            assert not state.armed
            assert not firmware.armed, hundredths
            before = list(firmware.motions)
            assert all(not one.armed for one in ends.watch(4.0))
            assert firmware.motions == before, hundredths
            flown += "take off" in before
    assert 0 < flown < 29


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"adress": "x"}, "adress"),
        ({"system": 0}, "system"),
        ({"fence": "stop"}, "fence"),
        ({"ready_timeout": -1}, "ready_timeout"),
        ({"way_home": [[1, 2, 3]]}, "way_home"),
        ({"fallback_after": 1}, "fallback_after"),
        ({"fallback": "on"}, "fallback"),
    ],
)
def test_settings_are_checked_by_name(settings: dict[str, object], complaint: str) -> None:
    """A misspelt setting is refused with the ones that exist."""
    robot = RobotConfig(id="m", driver="mavlink", settings=settings)
    with pytest.raises(ConfigError, match=f"robot m: settings: {complaint}"):
        MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))


def test_home_frame_needs_a_home() -> None:
    """Said when the vehicle is built, not in flight."""
    with pytest.raises(ConfigError, match="needs a home"):
        vehicle_at(1, frame="home")
