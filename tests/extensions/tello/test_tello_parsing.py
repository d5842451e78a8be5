"""Whatever comes over the air is understood whole or refused whole."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.extensions.tello.battery import BatteryGauge
from aerodaas.extensions.tello.commands import (
    ENTER,
    LAND,
    STREAM_ON,
    TAKE_OFF,
    VERSION,
    Command,
    ports,
)
from aerodaas.extensions.tello.state import parse_state
from tools.tello_vehicle.flight import TelloFlight
from tools.tello_vehicle.options import TelloOptions

WHOLE = (
    b"mid:-1;x:-100;y:-100;z:-100;mpry:0,0,0;pitch:-5;roll:2;yaw:-90;vgx:3;vgy:-2;vgz:-10;"
    b"templ:60;temph:63;tof:110;h:100;bat:87;baro:-64.55;time:12;agx:-2.00;agy:0.00;agz:-999.00;\r\n"
)


def test_a_whole_packet_is_read_in_si_units() -> None:
    """Degrees, decimetres per second and centimetres become radians, m/s and metres."""
    state = parse_state(WHOLE)
    assert state is not None
    assert state.velocity == (0.3, -0.2, -1.0)
    assert state.height == 1.0
    assert state.ground_distance == 1.1
    assert state.battery == 87
    assert state.yaw == pytest.approx(-math.pi / 2)
    assert state.pitch == pytest.approx(math.radians(5)), "its nose-up sign is turned"
    assert state.temperature == 63.0


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


@pytest.mark.parametrize(
    "spoilt",
    [
        WHOLE.replace(b"bat:87", b"bat:187"),
        WHOLE.replace(b"bat:87", b"bat:nan"),
        WHOLE.replace(b"bat:87", b"bat:8_7"),
        WHOLE.replace(b"bat:87;", b""),
        WHOLE.replace(b"h:100", b"h:1e400"),
        WHOLE.replace(b"yaw:-90", b"yaw:inf"),
        WHOLE + WHOLE,
        WHOLE.decode().encode("utf-16"),
        b"ok",
        b"",
    ],
)
def test_broken_packets_are_refused(spoilt: bytes) -> None:
    """Out of range, not a number, missing, doubled, in another encoding."""
    assert parse_state(spoilt) is None


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


def test_only_ok_and_figures_count_as_done() -> None:
    """Everything else that a Tello says is a refusal."""
    done = [
        text
        for text in ("ok", "OK", "20", "error", "out of range", "okay", "")
        if Command.succeeded(text)
    ]
    assert done == ["ok", "OK", "20"]
    assert ports(8891, 11112).text == "port 8891 11112"


def test_a_battery_that_jumps_is_not_believed_at_once() -> None:
    """One packet with 0 % between packets with 80 % does not land the drone."""
    gauge = BatteryGauge()
    assert math.isnan(gauge.battery.fraction)
    for percent in (80, 80, 80, 0, 80, 79, 100, 0, 79):
        gauge.add(percent)
        assert 0.79 <= gauge.battery.fraction <= 0.8
    for _ in range(9):
        gauge.add(10)
    assert gauge.battery.fraction == pytest.approx(0.1)
