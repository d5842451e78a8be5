"""Signs, units and limits of what is said to a Tello and what it says: centimetres, percent."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.extensions.tello.commands import (
    ENTER,
    LAND,
    STILL,
    STREAM_ON,
    TAKE_OFF,
    VERSION,
    BodyMotion,
    Command,
    Sticks,
    StickScale,
    ports,
)
from aerodaas.extensions.tello.state import BatteryGauge, parse_state
from tools.tello_vehicle.flight import TelloFlight
from tools.tello_vehicle.options import TelloOptions

SCALE = StickScale(speed=2.0, climb=0.5, turn=1.25)
FIELDS = {
    "mid": "-1",
    "pitch": "-5",
    "roll": "2",
    "yaw": "-90",
    "vgx": "3",
    "vgy": "-2",
    "vgz": "-10",
    "templ": "60",
    "temph": "63",
    "tof": "110",
    "h": "-30",
    "bat": "87",
    "baro": "-64.55",
    "time": "12",
    "agx": "-2.00",
}


def packet(**changed: str) -> bytes:
    """A state packet with some of its fields changed."""
    return (
        ";".join(f"{name}:{value}" for name, value in (FIELDS | changed).items()) + ";"
    ).encode()


def test_each_figure_of_a_packet() -> None:
    """Degrees, dm/s, centimetres, percent and seconds; nose up is minus with us, down is plus z."""
    state = parse_state(packet())
    assert state is not None
    assert state.roll == math.radians(2)
    assert state.pitch == math.radians(5)
    assert state.yaw == math.radians(-90)
    assert state.velocity == (0.3, -0.2, -1.0)
    assert state.height == -0.3
    assert state.ground_distance == 1.1
    assert state.barometer == -64.55
    assert state.battery == 87
    assert isinstance(state.battery, int)
    assert state.motor_time == 12.0
    assert state.temperature == 63.0


@pytest.mark.parametrize(
    ("name", "lowest", "highest"),
    [
        ("pitch", -180, 180),
        ("roll", -180, 180),
        ("yaw", -180, 180),
        ("vgx", -300, 300),
        ("vgy", -300, 300),
        ("vgz", -300, 300),
        ("templ", -40, 150),
        ("temph", -40, 150),
        ("tof", 0, 10000),
        ("h", -10000, 10000),
        ("bat", 0, 100),
        ("baro", -1000, 10000),
        ("time", 0, 1000000),
    ],
)
def test_what_is_believable(name: str, lowest: int, highest: int) -> None:
    """From the lowest to the highest, both included; a packet with anything else is refused."""
    for value, believed in (
        (lowest - 1, False),
        (lowest, True),
        (highest, True),
        (highest + 1, False),
    ):
        assert (parse_state(packet(**{name: str(value)})) is not None) is believed
    fields = [f"{key}:{value}" for key, value in FIELDS.items() if key != name]
    assert parse_state(";".join([*fields, ""]).encode()) is None, "all of them are needed"


def test_blanks_and_fields_of_others_do_not_matter() -> None:
    """Nor do broken ones among those that nobody reads, nor what follows the last semicolon."""
    whole = parse_state(packet())
    assert parse_state(packet(mid="?", agx="")) == whole
    assert parse_state(packet().replace(b";", b" ; ").replace(b":", b": ")) == whole
    assert parse_state(packet() + b"bat:1") == whole
    assert parse_state(packet()[:-1]) == whole, "its last field is one that nobody reads"
    assert parse_state(packet() + b"bat:87;") is None, "twice is once too often"
    assert parse_state(packet(bat="87:1")) is None
    assert parse_state(packet(bat="+87")) == whole
    assert parse_state(packet(bat="")) is None


def test_what_is_cut_off_before_its_semicolon_counts_for_nothing() -> None:
    """The last field of all may have lost a digit."""
    cut = packet(mid="0").replace(b"agx:-2.00;", b"")
    assert parse_state(cut) is not None
    assert parse_state(cut[:-1]) is None, "time:12 may have been time:123"


@pytest.mark.parametrize(
    ("motion", "sticks"),
    [
        (BodyMotion(np.array([1.0, 0.0, 0.0])), Sticks(ahead=50)),
        (BodyMotion(np.array([0.0, 1.0, 0.0])), Sticks(right=-50)),
        (BodyMotion(np.array([0.0, 0.0, 0.25])), Sticks(up=50)),
        (BodyMotion(np.zeros(3), 0.25), Sticks(clockwise=-20)),
        (BodyMotion(np.array([-9.0, -9.0, -9.0]), -9.0), Sticks(100, -100, -100, 100)),
        (BodyMotion(np.array([9.0, 9.0, 9.0]), 9.0), Sticks(-100, 100, 100, -100)),
        (BodyMotion(np.array([0.03, -0.03, 0.0]), 0.0), Sticks(right=2, ahead=2)),
    ],
)
def test_which_stick_flies_where(motion: BodyMotion, sticks: Sticks) -> None:
    """Forward, left, up and against the clock to us; right, ahead, up and with the clock to it."""
    assert SCALE.sticks(motion) == sticks


def test_what_sticks_fly() -> None:
    """100 % are 2 m/s along, 0.5 m/s up and 1.25 rad/s; each stick moves one thing."""
    for sticks, velocity, rate in (
        (Sticks(right=100), (0.0, -2.0, 0.0), 0.0),
        (Sticks(ahead=50), (1.0, 0.0, 0.0), 0.0),
        (Sticks(up=-50), (0.0, 0.0, -0.25), 0.0),
        (Sticks(clockwise=40), (0.0, 0.0, 0.0), -0.5),
        (STILL, (0.0, 0.0, 0.0), 0.0),
    ):
        motion = SCALE.motion(sticks)
        assert motion.velocity == pytest.approx(velocity)
        assert motion.yaw_rate == pytest.approx(rate)


def test_one_bad_figure_centres_its_own_stick_alone() -> None:
    """The others are flown."""
    assert SCALE.sticks(BodyMotion(np.array([math.nan, 1.0, math.inf]), 0.25)) == Sticks(
        -50, 0, 0, -20
    )


def test_what_is_said() -> None:
    """Right, ahead, up, clockwise, in this order; and what may be said more than once."""
    assert Sticks(1, -2, 3, -4).text == "rc 1 -2 3 -4"
    assert STILL.text == "rc 0 0 0 0"
    assert [one.text for one in (ENTER, VERSION, STREAM_ON, TAKE_OFF, LAND)] == [
        "command",
        "sdk?",
        "streamon",
        "takeoff",
        "land",
    ]
    assert TAKE_OFF.tries == 1, "a take-off must not be asked for twice"
    assert (LAND.tries, ENTER.tries, ports(8890, 11111).tries) == (3, 3, 3)
    assert ports(1234, 5678).text == "port 1234 5678"
    assert ports(1, 2).timeout == 1.0


@pytest.mark.parametrize(
    ("percents", "charge"),
    [
        ([80], 0.8),
        ([80, 60], 0.7),
        ([80, 0, 79], 0.79),
        ([10] * 4 + [80] * 5, 0.8),
        ([10] * 5 + [80] * 4, 0.1),
        ([10] * 5 + [80] * 5, 0.8),
    ],
)
def test_the_middle_of_the_newest_nine_figures(percents: list[int], charge: float) -> None:
    """As a share of one; a tenth figure pushes the first out."""
    gauge = BatteryGauge()
    assert math.isnan(gauge.battery.fraction)
    for percent in percents:
        gauge.add(percent)
    assert gauge.battery.fraction == charge


WHOLE = packet()


@given(st.binary(max_size=300))
def test_noise_is_no_state(noise: bytes) -> None:
    """Random bytes are refused, without an exception."""
    assert parse_state(noise) is None


@given(st.integers(0, len(WHOLE) - 1))
def test_a_truncated_packet_never_gives_a_wrong_figure(length: int) -> None:
    """A cut packet is refused, or it has lost nothing that we read: never bat:8 of bat:87."""
    whole = parse_state(WHOLE)
    assert parse_state(WHOLE[:length]) in {None, whole}


@given(st.integers(0, len(WHOLE) - 1), st.integers(0, 255))
def test_a_changed_byte_never_gives_an_unbelievable_state(index: int, value: int) -> None:
    """One byte off: refused, or figures within their ranges."""
    content = bytearray(WHOLE)
    content[index] = value
    state = parse_state(bytes(content))
    if state is not None:
        assert 0 <= state.battery <= 100
        assert all(abs(axis) <= 30.0 for axis in state.velocity)
        assert abs(state.yaw) <= math.pi
        assert math.isfinite(state.height)


@given(st.floats(0.0, 1.0), st.floats(-180.0, 180.0))
def test_the_emulated_tello_sends_what_we_read(charge: float, yaw: float) -> None:
    """Both ends agree on the format, whatever the figures."""
    flight = TelloFlight(TelloOptions(battery=charge, start_yaw=yaw, start=(3.0, 4.0, 0.5)))
    state = parse_state(flight.state().encode())
    assert state is not None
    assert state.battery == round(100 * charge)
    assert state.yaw == 0.0, "it looks where it was switched on"


@pytest.mark.parametrize(
    ("command", "reply", "taken"),
    [
        (TAKE_OFF, "ok", True),
        (TAKE_OFF, "error Motor stop", True),
        (TAKE_OFF, "30", False),
        (VERSION, "30", True),
        (VERSION, "ok", False),
        (VERSION, "unknown command: sdk?", True),
        (ENTER, "87", False),
    ],
)
def test_a_reply_to_another_kind_of_command_is_not_taken(
    command: Command, reply: str, *, taken: bool
) -> None:
    """Replies carry no id, but numbers answer questions only."""
    assert command.accepts(reply) is taken


@given(
    st.binary(max_size=40) | st.sampled_from([b"ok", b"OK", b"30", b"error", b"unknown command: x"])
)
def test_noise_is_never_a_commands_success(noise: bytes) -> None:
    """Whatever comes: a request is done by `ok` alone, a question by a number alone."""
    reply = noise.decode("ascii", "replace").strip()
    for command in (ENTER, TAKE_OFF, LAND, STREAM_ON, ports(8891, 11112)):
        if command.accepts(reply) and command.succeeded(reply):
            assert reply.lower() == "ok"
    if VERSION.accepts(reply) and VERSION.succeeded(reply):
        assert int(reply) >= 0
