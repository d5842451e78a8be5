"""The signing key, and whose packets pass: read in both forms, never shown, never half believed."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest
from pydantic import SecretStr

from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.signing import load_key, sign_with, signature_fits
from aerodaas.errors import ConfigError

KEY = bytes(range(32))
BEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)


@pytest.fixture(autouse=True)
def _no_key_of_the_host(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(MAVLINK_KEY, raising=False)


def sender(key: bytes | None) -> Any:  # noqa: ANN401 - pymavlink has no types
    """One end, which signs with `key`."""
    mav = mavlink.MAVLink(None, 1, 1)
    if key is not None:
        sign_with(mav, key)
    return mav


def packet(key: bytes | None) -> bytearray:
    """A heartbeat."""
    return bytearray(BEAT.pack(sender(key)))


@pytest.mark.parametrize(
    "content",
    [KEY, KEY.hex().encode(), KEY.hex().upper().encode(), b" " + KEY.hex().encode() + b"\n"],
)
def test_a_key_in_a_file(tmp_path: Path, content: bytes) -> None:
    """32 bytes, or 64 hexadecimal digits with whatever blanks an editor left around them."""
    path = tmp_path / "key"
    path.write_bytes(content)
    assert load_key(MavlinkSettings(signing_key=SecretStr(str(path))), "d") == KEY


def test_a_key_in_the_environment_takes_the_files_place(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Even one that is not there; an empty variable is none, and no key at all is unsigned."""
    settings = MavlinkSettings(signing_key=SecretStr(str(tmp_path / "none")))
    monkeypatch.setenv(MAVLINK_KEY, KEY.hex())
    assert load_key(settings, "d") == KEY
    assert load_key(MavlinkSettings(), "d") == KEY
    monkeypatch.setenv(MAVLINK_KEY, "")
    assert load_key(MavlinkSettings(), "d") is None
    with pytest.raises(ConfigError, match=r"d: cannot read the file that signing_key names"):
        load_key(settings, "d")


@pytest.mark.parametrize(
    "content",
    [b"", KEY[:31], KEY + b"\n", KEY.hex()[:62].encode(), KEY.hex().encode() + b"00", b"g" * 64],
)
def test_what_is_no_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes) -> None:
    """Too short, too long, or no digits: named by its place, and never shown."""
    path = tmp_path / "key"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="must be 32 bytes or 64 hexadecimal digits") as refused:
        load_key(MavlinkSettings(signing_key=SecretStr(str(path))), "drone")
    assert str(path) in str(refused.value)
    assert "drone" in str(refused.value)
    assert content.decode("latin-1")[:20] not in str(refused.value) or not content
    monkeypatch.setenv(MAVLINK_KEY, "beef")
    with pytest.raises(ConfigError, match=MAVLINK_KEY):
        load_key(MavlinkSettings(), "drone")


def test_a_signed_packet_passes_whoever_has_the_key() -> None:
    """The other end believes it; one with another key, or an unsigned one, it does not."""
    frame = packet(KEY)
    assert signature_fits(KEY, frame)
    assert not signature_fits(bytes(32), frame)
    ear = sender(KEY)
    heard = ear.decode(bytearray(packet(KEY)))
    assert heard.get_type() == "HEARTBEAT"
    for foreign in (packet(None), packet(bytes(32))):
        with pytest.raises(mavlink.MAVError):
            sender(KEY).decode(foreign)


def test_a_signature_covers_every_byte() -> None:
    """Header, payload, checksum, time and the signature itself: a bit in any of them spoils it."""
    frame = packet(KEY)
    for index in range(1, len(frame)):
        spoilt = bytearray(frame)
        spoilt[index] ^= 0x80
        assert not signature_fits(KEY, spoilt), index


def test_a_radio_may_speak_unsigned() -> None:
    """RADIO_STATUS is put into the stream by what has no key; nothing else is let through."""
    radio = mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
    assert sender(KEY).decode(bytearray(radio.pack(sender(None)))).get_type() == "RADIO_STATUS"


@pytest.fixture
def ticking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time passes by a tick with each look."""
    ticks = itertools.count()
    monkeypatch.setattr("time.time", lambda: 2e9 + next(ticks) * 1e-5)


@pytest.mark.usefixtures("ticking")
def test_a_hundred_runs_are_one_stream_to_the_vehicle() -> None:
    """It remembers sixteen until it is started again; each run begins after the one before."""
    vehicle = sender(KEY)
    for _ in range(100):
        assert vehicle.decode(packet(KEY)).get_type() == "HEARTBEAT"
    assert len(vehicle.signing.stream_timestamps) == 1


@pytest.mark.usefixtures("ticking")
def test_two_processes_at_once_are_no_replay_of_each_other() -> None:
    """A flight goes on being heard while the vehicle is looked at beside it, one packet each."""
    vehicle, flight = sender(KEY), sender(KEY)
    look = sender(KEY)
    for _ in range(50):
        for one in (flight, look, look, flight):
            assert vehicle.decode(bytearray(BEAT.pack(one))).get_type() == "HEARTBEAT"


@pytest.mark.usefixtures("ticking")
def test_a_vehicle_whose_clock_is_ahead_is_caught_up_with() -> None:
    """What is signed after one of its packets is newer than that, though the clock is behind."""
    vehicle, ours = sender(KEY), sender(KEY)
    vehicle.signing.timestamp = ahead = ours.signing.timestamp + 3600 * 100_000
    ours.decode(bytearray(BEAT.pack(vehicle)))
    assert ours.signing.timestamp >= ahead
    before = ours.signing.timestamp
    BEAT.pack(ours)
    assert ours.signing.timestamp == before + 1


def test_vehicles_on_one_radio_are_streams_of_their_own() -> None:
    """Each hears what is signed for the others; an id has one byte."""
    for vehicle, link in ((1, 1), (255, 255), (256, 0)):
        mav = mavlink.MAVLink(None, 1, 1)
        sign_with(mav, KEY, vehicle)
        assert bytearray(BEAT.pack(mav))[-13] == link
