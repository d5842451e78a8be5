"""Other aircraft over MAVLink: who is believed, where they are by now, and who is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from emulated import FAMILIES, Stepped
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.traffic.settings import TrafficConfig
from aerodaas.extensions.traffic.table import TrafficTable
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.vehicle import Traffic
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.aircraft import EmulatedAircraft

ORIGIN = GeodeticOrigin(47.397742, 8.545594, 0.0)
SEA = 488.0
HERE = np.zeros(3)
ALL = 1 | 2 | 4 | 8 | 16 | 128


def report(**fields: Any) -> Any:  # noqa: ANN401
    """An ADSB_VEHICLE as it is decoded: 1 km north, 100 m up, flying east at 50 m/s, sinking."""
    latitude, longitude, _ = ORIGIN.to_geodetic(np.array([0.0, 1000.0, 0.0]))
    usual = {
        "ICAO_address": 0x4B1234,
        "lat": round(latitude * 1e7),
        "lon": round(longitude * 1e7),
        "altitude_type": mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH,
        "altitude": 588_000,
        "heading": 9000,
        "hor_velocity": 5000,
        "ver_velocity": -200,
        "callsign": b"HBXYZ",
        "emitter_type": mavlink.ADSB_EMITTER_TYPE_LIGHT,
        "tslc": 0,
        "flags": ALL,
        "squawk": 7000,
    }
    codec = mavlink.MAVLink(None, 1, 1)
    message = mavlink.MAVLink_adsb_vehicle_message(**{**usual, **fields})
    return codec.decode(bytearray(message.pack(codec)))


def at(east: float, north: float) -> dict[str, int]:
    """The fields of a place, metres from our zero."""
    latitude, longitude, _ = ORIGIN.to_geodetic(np.array([east, north, 0.0]))
    return {"lat": round(latitude * 1e7), "lon": round(longitude * 1e7)}


def table(**config: Any) -> TrafficTable:  # noqa: ANN401
    """One that has heard nobody."""
    return TrafficTable(TrafficConfig(**config))


def take(known: TrafficTable, now: float = 0.0, sea: float | None = SEA, **fields: Any) -> None:  # noqa: ANN401
    """Let it hear a report."""
    known.update(report(**fields), now, ORIGIN, sea, HERE)


def heard(now: float = 0.0, sea: float | None = SEA, **fields: Any) -> tuple[Traffic, ...]:  # noqa: ANN401
    """What is known of one report, `now` seconds after it came."""
    known = table()
    take(known, 0.0, sea, **fields)
    assert known.heard
    assert bool(known.ignored) is (known.around(HERE, 0.0) == ())
    return known.around(HERE, now)


def test_an_aircraft_is_where_it_was_heard_and_flies_on() -> None:
    """In our frame and units, for as long as it is heard of."""
    (one,) = heard()
    assert one.position.tolist() == pytest.approx([0.0, 1000.0, 100.0], abs=0.1)
    assert one.velocity.tolist() == pytest.approx([50.0, 0.0, -2.0])
    assert (one.callsign, one.address, one.age) == ("HBXYZ", 0x4B1234, 0.0)
    (later,) = heard(4.0)
    assert later.position.tolist() == pytest.approx([200.0, 1000.0, 92.0], abs=0.1)
    assert later.age == 4.0


def test_after_ten_seconds_it_is_forgotten() -> None:
    """At ten it is not; what is older from the start is not believed."""
    assert len(heard(10.0)) == 1
    assert heard(10.001) == ()
    assert len(heard(4.0, tslc=6)) == 1
    assert heard(4.001, tslc=6) == ()
    assert len(heard(tslc=10)) == 1
    assert heard(tslc=11) == ()


@pytest.mark.parametrize(
    "lie",
    [
        {"flags": ALL & ~1},
        {"flags": 0},
        {"lat": 0, "lon": 0},
        {"lat": 900_000_001},
        {"lat": -(2**31)},
        {"lon": 1_800_000_001},
        {"lon": 2**31 - 1},
        {"altitude": 30_000_001},
        {"altitude": -1_000_001},
        {"altitude": 2**31 - 1},
        {"heading": 36_001},
        {"heading": 65_535},
        {"hor_velocity": 40_001},
        {"hor_velocity": 65_535},
        {"ICAO_address": 0},
        {"ICAO_address": 1 << 24},
        {"ICAO_address": 2**32 - 1},
        {"tslc": 255},
    ],
)
def test_what_cannot_be_is_not_believed_and_counted(lie: dict[str, int]) -> None:
    """Values that mean "unknown", places off the earth, speeds of no aircraft."""
    assert heard(**lie) == ()


def test_a_height_that_is_not_known_is_none() -> None:
    """By its flag, or because nobody knows how high our own zero lies."""
    for one in (*heard(flags=ALL & ~2), *heard(sea=None)):
        assert not one.knows_height
        assert one.position[:2].tolist() == pytest.approx([0.0, 1000.0], abs=0.1)
    # A height without its flag is not looked at.
    assert len(heard(flags=ALL & ~2, altitude=2**31 - 1)) == 1
    assert heard()[0].knows_height


@pytest.mark.parametrize(
    ("callsign", "flags", "shown"),
    [
        (b"SWR12A", ALL, "SWR12A"),
        (b"", ALL, "4B1234"),
        (b"HBXYZ", ALL & ~16, "4B1234"),
        (b"AB \x1b[3m\xff", ALL, "AB3m"),
    ],
)
def test_a_callsign_can_be_printed(callsign: bytes, flags: int, shown: str) -> None:
    """The address takes its place."""
    (one,) = heard(callsign=callsign, flags=flags)
    assert one.callsign == shown


def test_the_drones_own_echo_and_cars_are_no_traffic() -> None:
    """Neither are they lies."""
    known = table(own_address="4b1234")
    take(known)
    take(known, ICAO_address=0x4B1235, emitter_type=mavlink.ADSB_EMITTER_TYPE_SERVICE_SURFACE)
    take(known, ICAO_address=0x4B1236, emitter_type=mavlink.ADSB_EMITTER_TYPE_EMERGENCY_SURFACE)
    assert known.around(HERE, 0.0) == ()
    assert known.ignored == 0
    take(known, ICAO_address=0x4B1237)
    assert [one.address for one in known.around(HERE, 0.0)] == [0x4B1237]


def test_a_leap_is_not_believed() -> None:
    """From 1 km north to 5 km north in a second; a moment after it is gone, it may be anywhere."""
    known = table()
    take(known, 0.0)
    take(known, 1.0, **at(0.0, 5000.0))
    assert known.ignored == 1
    assert known.around(HERE, 1.0)[0].position[1] == pytest.approx(1000.0, abs=0.1)
    take(known, 1.0, **at(0.0, 1890.0))
    assert known.ignored == 1
    assert known.around(HERE, 1.0)[0].position[1] == pytest.approx(1890.0, abs=0.1)
    take(known, 11.1, **at(0.0, 50_000.0))
    assert known.ignored == 1


def test_of_many_the_nearest_are_kept_nearest_first() -> None:
    """32 of them, however they come."""
    for order in (range(1, 51), range(50, 0, -1)):
        known = table()
        for number in order:
            take(known, ICAO_address=number, hor_velocity=0, **at(0.0, 100.0 * number))
        kept = [one.address for one in known.around(HERE, 0.0)]
        assert kept == list(range(1, 33))
        assert known.ignored == 18


@given(
    st.fixed_dictionaries(
        {
            "ICAO_address": st.integers(0, 2**32 - 1),
            "lat": st.integers(-(2**31), 2**31 - 1),
            "lon": st.integers(-(2**31), 2**31 - 1),
            "altitude": st.integers(-(2**31), 2**31 - 1),
            "heading": st.integers(0, 65535),
            "hor_velocity": st.integers(0, 65535),
            "ver_velocity": st.integers(-32768, 32767),
            "callsign": st.binary(max_size=9),
            "emitter_type": st.integers(0, 255),
            "tslc": st.integers(0, 255),
            "flags": st.integers(0, 65535),
        }
    ),
    st.floats(0, 10),
)
def test_whatever_is_told_is_finite_or_ignored(fields: dict[str, Any], now: float) -> None:
    """But for a height that is not known."""
    known = table()
    take(known, **fields)
    for one in known.around(HERE, now):
        assert np.isfinite(one.position[:2]).all()
        assert np.isfinite(one.velocity).all()
        assert one.knows_height is bool(fields["flags"] & 2)
        assert 0.0 <= one.age <= 10.0
        assert one.callsign.isalnum()


def ends_of(
    monkeypatch: pytest.MonkeyPatch,
    family: str,
    *others: EmulatedAircraft,
    **settings: Any,  # noqa: ANN401
) -> Stepped:
    """Both ends, among others."""
    options = AutopilotOptions(family=family, start=(3.0, 4.0, 0.0))  # type: ignore[arg-type]
    ends = Stepped(monkeypatch, options, start=(3.0, 4.0, 0.0), **settings)
    ends.autopilot.firmware.traffic.aircraft.extend(others)
    return ends


@pytest.mark.parametrize("family", FAMILIES)
def test_a_state_has_what_flies_around(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In our frame, where it is at the state's own time; each second anew."""
    glider = EmulatedAircraft(1, "GLIDER", (200.0, -50.0, 80.0), (-10.0, 5.0, 1.0))
    balloon = EmulatedAircraft(2, "BALLOON", (0.0, 90.0, 60.0))
    liar = EmulatedAircraft(3, "LIAR", (9.0, 9.0, 9.0), lies={"lat": 0, "lon": 0})
    with ends_of(monkeypatch, family, glider, balloon, liar) as ends:
        states = ends.watch(12.0)[60:]
        firmware = ends.autopilot.firmware
        for state in states:
            assert {one.callsign for one in state.traffic} == {"GLIDER", "BALLOON"}
            assert all(one.age <= 1.3 for one in state.traffic)
        state = states[-1]
        by_name = {one.callsign: one for one in state.traffic}
        assert by_name["BALLOON"].position.tolist() == pytest.approx([0.0, 90.0, 60.0], abs=0.6)
        assert glider.begun is not None
        flown = firmware.now - glider.begun
        there = np.array(glider.position) + flown * np.array(glider.velocity)
        assert by_name["GLIDER"].position.tolist() == pytest.approx(there.tolist(), abs=1.5)
        assert by_name["GLIDER"].velocity.tolist() == pytest.approx([-10.0, 5.0, 1.0], abs=0.05)
        assert state.extra["traffic_ignored"] >= 6.0
        first = state.traffic[0].position - state.odometry.position
        second = state.traffic[1].position - state.odometry.position
        assert np.linalg.norm(first) <= np.linalg.norm(second)


@pytest.mark.parametrize("family", FAMILIES)
def test_traffic_is_asked_for_once_and_again_after_a_restart(
    family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing flies nothing comes, which is no reason to ask again."""

    def asked() -> int:
        number = float(mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE)
        wanted = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        told = ends.heard("COMMAND_LONG")
        return sum(one.command == wanted and one.param1 == number for one in told)

    with ends_of(monkeypatch, family) as ends:
        ends.watch(20.0)
        assert asked() == 1
        assert "traffic_ignored" not in ends.turn().extra
        ends.autopilot.restart()
        ends.watch(20.0)
        assert asked() == 2
        ends.autopilot.firmware.traffic.aircraft.append(EmulatedAircraft(position=(50, 0, 50)))
        ends.watch(4.0)
        assert len(ends.turn().traffic) == 1
