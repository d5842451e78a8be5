"""Corrections of a base station for RTK, read by a thread of its own and passed on at once."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.transport import Transport, is_exposed, open_transport
from aerodaas.drivers.waiting import wait_readable
from aerodaas.errors import ConfigError, VehicleError

__all__ = ["LARGEST", "Corrections", "RtcmFramer", "crc24q", "fragments"]

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


_log = logging.getLogger(__name__)

_STALE = 10.0
"""Seconds without a message after which it is told: receivers leave RTK after some 30."""
_RETRY = 1.0
"""Seconds between attempts to open the source."""
_TICK = 0.2
"""Longest time between two looks at it, seconds."""
_RATE = 5000.0
"""Bytes a second that are passed on: a base station with four constellations sends 1500."""
_TOLD = 10.0
"""Seconds for which it is reported that some were left out."""


class Corrections:
    """Source of RTCM 3 messages, which are passed on as GPS_RTCM_DATA.

    Nothing waits: what comes faster than a vehicle's link should carry is left out.
    """

    def __init__(self, url: str, name: str, deliver: Callable[[Any], None]) -> None:
        """Read `url` for robot `name`; `deliver` is called by its thread for each fragment.

        A source that is not there yet is tried again. Raises ConfigError for an invalid address.
        """
        self.passed = 0
        """Messages that were passed on."""
        self.left_out = 0
        """Messages that came too fast, or are larger than MAVLink carries."""
        self._url = url
        self._name = name
        self._deliver = deliver
        self._framer = RtcmFramer()
        self._heard_at = time.monotonic()
        self._left_out_at = -math.inf
        self._room, self._filled_at = _RATE, self._heard_at
        self._closing = threading.Event()
        self._wire = self._opened()
        if is_exposed(url):
            _log.warning(
                "%s: corrections come from %s over a network, and nothing signs them: who can "
                "forge them there moves the position by metres",
                name,
                url,
            )
        self._thread = threading.Thread(target=self._run, name=f"{name}-rtcm", daemon=True)
        self._thread.start()

    @property
    def skipped(self) -> int:
        """Bytes that belong to no message."""
        return self._framer.skipped

    def _opened(self) -> Transport | None:
        if self._url.partition(":")[0] not in {"tcp", "serial"}:
            raise ConfigError(
                f"{self._name}: corrections come from tcp:HOST:PORT or serial:DEVICE:BAUD, not "
                f"{self._url!r}"
            )
        try:
            return open_transport(self._url, f"{self._name}, corrections")
        except VehicleError:
            return None

    def _run(self) -> None:
        while not self._closing.is_set():
            if self._wire is None:
                self._closing.wait(_RETRY)
                self._wire = self._opened()
                continue
            wait_readable([self._wire.fileno()], _TICK)
            for content, _ in self._wire.receive():
                for message in self._framer.feed(content):
                    self._pass(message, time.monotonic())
        if self._wire is not None:
            self._wire.close()

    def _pass(self, message: bytes, now: float) -> None:
        self._heard_at = now
        self._room = min(_RATE, self._room + (now - self._filled_at) * _RATE)
        self._filled_at = now
        if len(message) > min(LARGEST, self._room):
            self.left_out += 1
            self._left_out_at = now
            return
        self._room -= len(message)
        for part in fragments(message, self.passed):
            self._deliver(part)
        self.passed += 1

    def reports(self, now: float) -> list[str]:
        """Reports for the operator at `now`, one sentence each."""
        said = []
        if now - self._heard_at > _STALE:
            said.append(f"corrections: none from {self._url}")
        if now - self._left_out_at <= _TOLD:
            said.append(f"corrections: more from {self._url} than is passed on")
        return said

    def close(self) -> None:
        """End the thread and close the source."""
        self._closing.set()
        self._thread.join(timeout=2.0)
