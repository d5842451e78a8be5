"""RTCM 3: messages of a base station, cut out of its bytes, and as MAVLink passes them on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["LARGEST", "RtcmFramer", "crc24q", "fragments"]

_PREAMBLE = 0xD3
_HEADER = 3
"""Bytes: preamble, six reserved bits that are zero, ten bits of length (RTCM 10403)."""
_CHECKSUM = 3
_LENGTH_HIGH = 0x03
_GENERATOR = 0x1864CFB
"""CRC-24Q's polynomial (RTCM 10403, section 4)."""
_ONE = 180
"""Bytes in one GPS_RTCM_DATA (common.xml, message 233)."""
_MOST = 4
"""Fragments of one message: two bits count them."""
LARGEST = _ONE * _MOST
"""Bytes of the largest message that MAVLink can pass on."""
_SEQUENCES = 32
"""Sequence ids: five bits."""


def _table() -> tuple[int, ...]:
    rows = []
    for byte in range(256):
        rest = byte << 16
        for _ in range(8):
            rest <<= 1
            if rest & 0x1000000:
                rest ^= _GENERATOR
        rows.append(rest)
    return tuple(rows)


_TABLE = _table()


def crc24q(content: bytes | bytearray) -> int:
    """CRC-24Q of these bytes, 24 bits."""
    rest = 0
    for byte in content:
        rest = (rest << 8) & 0xFFFFFF ^ _TABLE[rest >> 16 ^ byte]
    return rest


class RtcmFramer:
    """Extractor of whole messages with a valid checksum from a stream of bytes."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.skipped = 0
        """Bytes that belong to no message."""

    def feed(self, content: bytes) -> Iterator[bytes]:
        """Process bytes, and yield the messages that they complete, header and checksum included.

        Keeps less than one message (1029 bytes) for the next call.
        """
        buffer = self._buffer
        buffer += content
        while True:
            start = buffer.find(_PREAMBLE)
            self._skip(len(buffer) if start < 0 else start)
            if len(buffer) < _HEADER:
                return
            if buffer[1] & ~_LENGTH_HIGH:
                self._skip(1)
                continue
            length = _HEADER + ((buffer[1] & _LENGTH_HIGH) << 8 | buffer[2]) + _CHECKSUM
            if len(buffer) < length:
                return
            message = bytes(buffer[:length])
            # Over the checksum, too, a whole message leaves no rest.
            if crc24q(message):
                self._skip(1)
                continue
            del buffer[:length]
            yield message

    def _skip(self, count: int) -> None:
        self.skipped += count
        del self._buffer[:count]


def fragments(message: bytes, sequence: int) -> list[Any]:
    """GPS_RTCM_DATA for one message.

    Its flags: bit 0 for a message in several parts, then two bits for the part, five for the
    sequence. A part that is not full is the last; so where all are full and fewer than four, an
    empty one ends them.

    Args:
        message: At most `LARGEST` bytes.
        sequence: Number of the message.
    """
    parts = [message[start : start + _ONE] for start in range(0, len(message), _ONE)]
    if len(parts) > 1 and len(parts) < _MOST and len(parts[-1]) == _ONE:
        parts.append(b"")
    several = len(parts) > 1
    return [
        mavlink.MAVLink_gps_rtcm_data_message(
            (sequence % _SEQUENCES) << 3 | number << 1 | several,
            len(part),
            list(part.ljust(_ONE, b"\0")),
        )
        for number, part in enumerate(parts)
    ]
