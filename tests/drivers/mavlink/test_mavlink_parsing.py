"""Bytes in, messages out: whatever comes, nothing breaks and nothing true is lost for long."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.mavlink.microservices.texts import Texts
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import EventMessage, mavlink
from aerodaas.drivers.mavlink.wire.framing import Framer

WANTED = frozenset({0, 30, 32, 77, 253, 410})


def decoder() -> Callable[[bytearray], Any]:
    """Decoding by pymavlink, with None for what is none."""
    mav = mavlink.MAVLink(None, 1, 1)

    def decode(frame: bytearray) -> Any:  # noqa: ANN401
        try:
            return mav.decode(frame)
        except mavlink.MAVError:
            return None

    return decode


def packets(count: int) -> list[bytes]:
    """Attitudes, numbered by their time."""
    mav = mavlink.MAVLink(None, 1, 1)
    made = []
    for index in range(count):
        message = mavlink.MAVLink_attitude_message(index, 0.1, 0.2, 0.3, 0, 0, 0)
        made.append(message.pack(mav))
    return made


@given(st.lists(st.integers(1, 60), max_size=30))
def test_packets_come_out_however_they_are_cut(cuts: list[int]) -> None:
    """A stream in pieces of any length yields each packet once, in order."""
    whole = b"".join(packets(8))
    framer = Framer(WANTED, decoder())
    seen: list[int] = []
    for cut in [*cuts, len(whole)]:
        piece, whole = whole[:cut], whole[cut:]
        seen += [message.time_boot_ms for message in framer.feed(piece)]  # type: ignore[attr-defined]
    assert seen == list(range(8))
    assert framer.damaged == 0


@given(st.lists(st.binary(max_size=40), min_size=4, max_size=4))
def test_garbage_between_packets_costs_little(garbage: list[bytes]) -> None:
    """After any garbage, packets are found again as soon as the stream is clean for a while."""
    framer = Framer(WANTED, decoder())
    for noise, packet in zip(garbage, packets(4), strict=True):
        list(framer.feed(noise + packet))
    tail = packets(30)
    found = [message.time_boot_ms for packet in tail for message in framer.feed(packet)]  # type: ignore[attr-defined]
    assert found[-15:] == list(range(15, 30))


@given(st.binary(max_size=2000))
def test_pure_garbage_is_survived(noise: bytes) -> None:
    """No exception, and no more memory than a packet or two."""
    framer = Framer(WANTED, decoder())
    list(framer.feed(noise))
    assert len(framer._buffer) <= 4096


def test_what_nobody_wants_is_not_decoded() -> None:
    """Packets of other kinds are skipped by their header."""
    mav = mavlink.MAVLink(None, 1, 1)
    other = mavlink.MAVLink_vfr_hud_message(1, 2, 3, 4, 5, 6).pack(mav)
    decoded: list[bytearray] = []

    def decode(frame: bytearray) -> bytearray:
        decoded.append(frame)
        return frame

    framer = Framer(WANTED, decode)
    assert len(list(framer.feed(other + packets(1)[0] + other))) == 1
    assert len(decoded) == 1


def _vehicle() -> MavlinkVehicle:
    robot = RobotConfig(id="m", driver="mavlink")
    return MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))


integer = st.integers(0, 255)


@settings(max_examples=200)
@given(
    st.lists(
        st.tuples(st.sampled_from(sorted(mavlink.mavlink_map)), st.binary(max_size=255), integer),
        max_size=20,
    )
)
def test_any_message_of_anybody_is_survived(
    messages: list[tuple[int, bytes, int]],
) -> None:
    """Any payload under any message id, from any system: no crash, and nothing is asked for."""
    vehicle = _vehicle()
    mav = mavlink.MAVLink(None, 1, 1)
    for number, payload, system in messages:
        kind = mavlink.mavlink_map[number]
        size = kind.unpacker.size
        frame = bytearray((payload + bytes(size))[:size])
        header = bytearray([0xFD, size, 0, 0, 0, system, 1, *number.to_bytes(3, "little")])
        crc = mavlink.x25crc(header[1:] + frame + bytes([kind.crc_extra]))
        frame = header + frame + crc.crc.to_bytes(2, "little")
        try:
            message = mav.decode(frame)
        except mavlink.MAVError:
            continue
        vehicle._on_message(message, 1.0, None)
        if vehicle._finder.found is not None:
            vehicle._telemetry.on_message(message, 1.0)
    assert vehicle._phase.wish is None


def test_an_event_travels() -> None:
    """The message that pymavlink lacks packs and unpacks."""
    mav = mavlink.MAVLink(None, 1, 1)
    sent = EventMessage(0, 255, 0x01ABCDEF, 5, 7, 0x33, list(range(40)))
    got = mav.decode(bytearray(sent.pack(mav)))
    assert (got.event, got.sequence, got.log_levels) == (0x01ABCDEF, 7, 0x33)
    assert got.arguments == list(range(40))


@given(st.lists(st.tuples(st.text(max_size=50), st.integers(0, 9), st.integers(0, 9)), max_size=30))
def test_texts_in_pieces(pieces: list[tuple[str, int, int]]) -> None:
    """Whatever pieces come, memory is bounded and nothing but printable text comes out."""
    texts = Texts()
    for text, number, piece in pieces:
        texts.add_statustext(text, 3, 1.0, number, piece)
    assert len(texts._pieces) <= 16
    assert all(text.isprintable() for text in texts.recent(1.0, 5.0))
