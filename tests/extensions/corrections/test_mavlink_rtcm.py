"""RTCM 3 in bytes and in MAVLink."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rtcm_station import rtcm

from aerodaas.extensions.corrections.corrections import LARGEST, RtcmFramer, crc24q, fragments

# The worked example of RTCM 10403, a reference station's place (message 1005).
EXAMPLE = bytes.fromhex("D300133ED7D30202980EDEEF34B4BD62AC0941986F33360B98")


def assembled(parts: list[Any]) -> list[bytes]:
    """The messages of an autopilot's buffer, by the words of common.xml."""
    done: list[bytes] = []
    buffer: list[bytes] = []
    for part in parts:
        content = bytes(part.data[: part.len])
        if not part.flags & 1:
            done.append(content)
            continue
        number = part.flags >> 1 & 3
        buffer = [*buffer[:number], content]
        assert len(buffer) == number + 1, "a part is missing"
        if len(content) < 180 or number == 3:
            done.append(b"".join(buffer))
    return done


def test_the_standards_own_example() -> None:
    """Its checksum is CRC-24Q."""
    assert crc24q(EXAMPLE[:-3]) == int.from_bytes(EXAMPLE[-3:], "big")
    assert list(RtcmFramer().feed(EXAMPLE)) == [EXAMPLE]


@given(
    st.lists(st.one_of(st.binary(max_size=30), st.binary(max_size=1023).map(rtcm)), max_size=6),
    st.integers(1, 400),
)
def test_whole_messages_are_found_in_pieces_of_any_size(pieces: list[bytes], size: int) -> None:
    """All bytes are accounted for, and what is found has a valid checksum."""
    stream = b"".join(pieces)
    framer = RtcmFramer()
    found = [
        one for at in range(0, len(stream), size) for one in framer.feed(stream[at : at + size])
    ]
    assert all(crc24q(one) == 0 and one in stream for one in found)
    assert sum(map(len, found)) + framer.skipped <= len(stream)
    assert len(stream) - sum(map(len, found)) - framer.skipped < 1029


@given(st.binary(max_size=60).filter(lambda one: 0xD3 not in one), st.binary(max_size=1023))
def test_bad_bytes_are_skipped(noise: bytes, payload: bytes) -> None:
    """Noise before, and a message whose checksum is wrong, cost nothing behind them."""
    broken = rtcm(b"\x01\x02\x03")[:-1] + b"\x00\xff"
    framer = RtcmFramer()
    assert rtcm(payload) in list(framer.feed(noise + broken + rtcm(payload)))
    assert framer.skipped >= len(noise)


@pytest.mark.parametrize(
    ("length", "parts"),
    [(6, 1), (180, 1), (181, 2), (360, 3), (361, 3), (540, 4), (541, 4), (720, 4)],
)
def test_parts_are_put_together_again(length: int, parts: int) -> None:
    """Where each is full an empty one ends them, or the autopilot would wait for more."""
    message = rtcm(bytes(number % 251 for number in range(length - 6)))
    made = fragments(message, 33)
    assert len(made) == parts
    assert {part.flags >> 3 for part in made} == {1}
    assert [part.flags >> 1 & 3 for part in made] == list(range(parts))
    assert {part.flags & 1 for part in made} == {int(parts > 1)}
    assert {len(part.data) for part in made} == {180}
    assert assembled(made) == [message]


@given(st.lists(st.binary(max_size=LARGEST - 6).map(rtcm), max_size=8))
def test_messages_in_a_row_do_not_mix(messages: list[bytes]) -> None:
    """Each has its own sequence id."""
    parts = [part for number, one in enumerate(messages) for part in fragments(one, number)]
    assert assembled(parts) == messages
