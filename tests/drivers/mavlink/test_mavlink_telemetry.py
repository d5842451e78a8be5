"""What each kind of message says, in whose units, and for how long it is believed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aerodaas.drivers.mavlink.microservices.events import event_number
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def beat(state: int, base: int = ARMED, custom: int = 0) -> Any:  # noqa: ANN401 - no types there
    """A HEARTBEAT."""
    return mavlink.MAVLink_heartbeat_message(2, 12, base, custom, state, 3)


def local(boot: int, *values: float) -> Any:  # noqa: ANN401
    """A local position of x, y, z, vx, vy, vz."""
    return mavlink.MAVLink_local_position_ned_message(boot, *(values or (0.0,) * 6))


def attitude(boot: int, *angles: float) -> Any:  # noqa: ANN401
    """Roll, pitch, yaw and their rates."""
    return mavlink.MAVLink_attitude_message(boot, *(angles or (0.0,) * 6))


def globe(boot: int, latitude: int, longitude: int, altitude: int) -> Any:  # noqa: ANN401
    """A global position."""
    return mavlink.MAVLink_global_position_int_message(
        boot, latitude, longitude, altitude, 77, 0, 0, 0, 0
    )


def gps(fix: int = 3, satellites: int = 9, ellipsoid: int = 535123) -> Any:  # noqa: ANN401
    """47.5 degrees north, 8.25 west, 488 m above the sea."""
    return mavlink.MAVLink_gps_raw_int_message(
        0, fix, 475000000, -82500000, 488000, 80, 80, 0, 0, satellites, ellipsoid, 1500, 2500
    )


def status(left: int = 87, voltage: int = 15300, current: int = 1234) -> Any:  # noqa: ANN401
    """A battery and the sensors' bits: present, enabled, healthy."""
    return mavlink.MAVLink_sys_status_message(
        7, 6, 5, 100, voltage, current, left, 0, 0, 0, 0, 0, 0
    )


def told(*messages: Any, now: float = 10.0) -> Telemetry:  # noqa: ANN401
    """What is known after these messages, all at once."""
    telemetry = Telemetry()
    for message in messages:
        telemetry.on_message(message, now)
    return telemetry


PLACES = {"home", "place", "altitude", "gps", "sensors", "on_ground"}


def unknown(telemetry: Telemetry) -> set[str]:
    """What it does not know, of what may be unknown."""
    return {name for name in {*PLACES, "position"} if getattr(telemetry, name) is None}


@pytest.mark.parametrize(
    ("state", "base", "armed", "critical"),
    [
        (mavlink.MAV_STATE_ACTIVE, ARMED, True, False),
        (mavlink.MAV_STATE_ACTIVE, 0xFF & ~ARMED, False, False),
        (mavlink.MAV_STATE_CRITICAL, ARMED | 1, True, True),
        (mavlink.MAV_STATE_EMERGENCY, ARMED, True, True),
        (mavlink.MAV_STATE_FLIGHT_TERMINATION, ARMED, False, False),
        (mavlink.MAV_STATE_STANDBY, 0, False, False),
    ],
)
def test_a_heartbeat(state: int, base: int, *, armed: bool, critical: bool) -> None:
    """Armed by its own bit, unless it is terminated; critical in two of its states."""
    telemetry = told(beat(state, base, 0x04030000), now=5.0)
    assert (telemetry.armed, telemetry.critical) == (armed, critical)
    assert (telemetry.custom_mode, telemetry.beat_at, telemetry.heard_at) == (0x04030000, 5.0, 5.0)
    assert telemetry.seen == {"HEARTBEAT": 5.0}


def test_a_local_position_stays_in_the_autopilots_frame() -> None:
    """North, east, down, each its own; one that is no number leaves the one before."""
    telemetry = told(local(1000, 1.0, 2.0, -3.0, 0.1, 0.2, -0.3))
    assert telemetry.position is not None
    assert telemetry.position == pytest.approx([1.0, 2.0, -3.0])
    assert telemetry.velocity == pytest.approx([0.1, 0.2, -0.3])
    assert telemetry.position_at == 10.0
    for index in range(6):
        spoilt = [9.0] * 6
        spoilt[index] = math.nan
        telemetry.on_message(local(1001 + index, *spoilt), 11.0)
        assert telemetry.position == pytest.approx([1.0, 2.0, -3.0])
        assert telemetry.velocity == pytest.approx([0.1, 0.2, -0.3])
        assert telemetry.position_at == 10.0


@pytest.mark.parametrize(
    ("position_at", "attitude_at", "known"),
    [
        (10.0, 10.0, True),
        (9.01, 9.01, True),
        (9.0, 10.0, False),
        (10.0, 9.0, False),
    ],
)
def test_a_place_is_known_for_less_than_a_second(
    position_at: float, attitude_at: float, *, known: bool
) -> None:
    """Both where it is and how it stands."""
    telemetry = Telemetry()
    telemetry.on_message(local(1000), position_at)
    telemetry.on_message(attitude(1000), attitude_at)
    assert telemetry.knows_place(10.0) is known


def test_a_global_position_is_in_degrees_and_metres() -> None:
    """Times 10^7, and in millimetres above the sea; zero on one axis alone is a place."""
    telemetry = told(globe(1, 473977420, -85455940, 488123))
    assert telemetry.place == pytest.approx((47.397742, -8.545594))
    assert telemetry.altitude == 488.123
    telemetry.on_message(globe(2, 0, 85455940, 5000), 10.0)
    assert telemetry.place == pytest.approx((0.0, 8.545594))
    telemetry.on_message(globe(3, 473977420, 0, 6000), 10.0)
    assert telemetry.place == pytest.approx((47.397742, 0.0))
    telemetry.on_message(globe(4, 0, 0, 6000), 10.0)
    assert {"place", "altitude"} <= unknown(telemetry)


@pytest.mark.parametrize(
    ("state", "on_ground"),
    [
        (mavlink.MAV_LANDED_STATE_UNDEFINED, None),
        (mavlink.MAV_LANDED_STATE_ON_GROUND, True),
        (mavlink.MAV_LANDED_STATE_IN_AIR, False),
        (mavlink.MAV_LANDED_STATE_TAKEOFF, False),
        (mavlink.MAV_LANDED_STATE_LANDING, False),
    ],
)
def test_its_own_word_about_the_ground(state: int, *, on_ground: bool | None) -> None:
    """It may not know; what still lands is not on the ground."""
    assert told(mavlink.MAVLink_extended_sys_state_message(0, state)).on_ground is on_ground


@pytest.mark.parametrize(
    ("latitude", "longitude", "known"),
    [(900000000, -1800000000, True), (900000001, 0, False), (0, 1800000001, False)],
)
def test_a_place_beyond_the_earth_is_none(latitude: int, longitude: int, *, known: bool) -> None:
    """Neither by the GPS nor by its own estimate."""
    gps = mavlink.MAVLink_gps_raw_int_message(0, 3, latitude, longitude, 0, 0, 0, 0, 0, 9)
    place = mavlink.MAVLink_global_position_int_message(1000, latitude, longitude, 0, 0, 0, 0, 0, 0)
    telemetry = told(gps, place)
    assert (telemetry.gps is not None) is known
    assert (telemetry.place is not None) is known


@pytest.mark.parametrize(
    ("left", "charge"), [(100, 1.0), (0, 0.0), (101, math.nan), (-1, math.nan)]
)
def test_a_charge_beyond_a_full_battery_is_unknown(left: int, charge: float) -> None:
    """As one that is not told."""
    status = mavlink.MAVLink_sys_status_message(1, 1, 1, 0, 12000, 500, left, 0, 0, 0, 0, 0, 0)
    assert told(status).battery.fraction == pytest.approx(charge, nan_ok=True)


def test_its_clock_and_its_version() -> None:
    """Microseconds of the Unix epoch; bytes of the version from the highest on."""
    clock = mavlink.MAVLink_system_time_message(1_700_000_000_250_000, 4000)
    telemetry = told(clock)
    assert (telemetry.clock, telemetry.boot_time) == (1_700_000_000.25, 4.0)
    version = mavlink.MAVLink_autopilot_version_message(
        0, 0x010F02FF, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0
    )
    assert told(version).software == "1.15.2"


def test_its_words_are_kept_for_a_while() -> None:
    """Texts, also in pieces or with bytes that are no letters, and events; each with its time."""
    telemetry = told(mavlink.MAVLink_statustext_message(3, b"Motors \xff out\0..", 0, 0))
    assert telemetry.texts.recent(10.0, 1.0) == ["Motors \N{REPLACEMENT CHARACTER} out"]
    piece = mavlink.MAVLink_statustext_message(3, b"A" * 50, 4, 0)
    rest = mavlink.MAVLink_statustext_message(3, b"and more", 4, 1)
    telemetry = told(piece, rest, now=20.0)
    assert telemetry.texts.recent(20.0, 1.0) == ["A" * 50 + "and more"]
    number = event_number("commander_kill_sw_engaged")
    telemetry = told(mavlink.mavlink_map[410](0, 0, number, 0, 7, 2, [0] * 40), now=30.0)
    assert telemetry.texts.recent(30.0, 1.0) == ["the kill switch was used"]
    assert telemetry.texts.recent(40.0, 1.0) == []


def test_how_long_it_has_said_nothing_new() -> None:
    """Since its latest message, or since the latest whose stamp moved on, if that was before."""
    telemetry = told(local(1000), now=10.0)
    assert telemetry.silence(10.5) == 0.5
    telemetry.on_message(local(1000), 11.0)
    telemetry.on_message(beat(4), 11.5)
    assert telemetry.silence(12.0) == 2.0
    telemetry.on_message(attitude(1001), 12.0)
    assert telemetry.silence(12.25) == 0.25


def test_of_one_kind_only_what_is_newer_is_taken() -> None:
    """A packet that was overtaken, or comes twice, changes nothing; kinds count apart."""
    telemetry = told(local(2000, 2.0, 0, 0, 0, 0, 0))
    for stamp in (1999, 2000):
        telemetry.on_message(local(stamp, 9.0, 0, 0, 0, 0, 0), 10.5)
        assert telemetry.position is not None
        assert telemetry.position[0] == 2.0
        assert telemetry.position_at == 10.0
    telemetry.on_message(attitude(1999, 0.5, 0, 0, 0, 0, 0), 10.5)
    assert telemetry.attitude.roll == 0.5
    assert telemetry.boot_time == 2.0
    assert telemetry.ticked_at == 10.0
    telemetry.on_message(local(2001, 3.0, 0, 0, 0, 0, 0), 10.6)
    assert telemetry.position is not None
    assert telemetry.position[0] == 3.0
    assert telemetry.ticked_at == 10.6


@pytest.mark.parametrize(("stamp", "reboots"), [(5000, 0), (4999, 1)])
def test_a_clock_that_goes_back_by_more_than_five_seconds_began_anew(
    stamp: int, reboots: int
) -> None:
    """By less, a packet was only late."""
    telemetry = told(local(10000), local(stamp))
    assert telemetry.reboots == reboots
    assert telemetry.boot_time == (stamp / 1000 if reboots else 10.0)
    assert telemetry.knows_place(10.0) is False


def test_of_another_life_of_the_autopilot_nothing_is_left() -> None:
    """Its places, its health and its stamps are forgotten; its charge and its mode are not."""
    home = mavlink.MAVLink_home_position_message(
        1, 2, 3, 1.0, 2.0, 3.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0
    )
    landed = mavlink.MAVLink_extended_sys_state_message(0, 1)
    before = (local(90000), attitude(90000), globe(90000, 1, 1, 1), gps(), status(), landed, home)
    telemetry = told(beat(4, ARMED, 0x60000), *before)
    assert telemetry.knows_place(10.0)
    health, events = telemetry.health, telemetry.events
    telemetry.on_message(local(1000, 5.0, 0, 0, 0, 0, 0), 10.1)
    assert telemetry.reboots == 1
    assert not telemetry.armed
    assert unknown(telemetry) == PLACES
    assert telemetry.attitude_at == -math.inf
    assert telemetry.health is not health
    assert telemetry.events is not events
    assert telemetry.boot_time == 1.0
    assert telemetry.position is not None
    assert telemetry.position[0] == 5.0, "the first word of its new life counts"
    assert not telemetry.knows_place(10.1)
    telemetry.on_message(attitude(1000), 10.2)
    assert telemetry.knows_place(10.2)
    assert telemetry.battery.fraction == 0.87
    assert telemetry.custom_mode == 0x60000


def test_a_start_is_told_once_by_heartbeats() -> None:
    """Of two HEARTBEATs that boot only the first, and only after one that did not."""
    telemetry = told(beat(mavlink.MAV_STATE_ACTIVE))
    telemetry.on_message(local(5000), 10.0)
    for now in (11.0, 12.0):
        telemetry.on_message(beat(mavlink.MAV_STATE_BOOT, ARMED), now)
        assert telemetry.reboots == 1
    assert telemetry.position_at == -math.inf
    assert np.isnan(telemetry.boot_time)
