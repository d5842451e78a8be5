"""Framing: extraction of the packets of interest from a stream of bytes.

Autopilots send hundreds of packets a second of no interest here, and decoding one in
Python costs more than a driver may take, so packets are cut out by their headers first.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator

__all__ = ["Framer", "senders", "signed"]

_V1, _V2 = 0xFE, 0xFD
_MARKS = (bytes([_V1]), bytes([_V2]))
_HEADER = {_V1: 6, _V2: 10}
_SYSTEM = {_V1: 3, _V2: 5}
"""Where the system id is; the component id follows."""
_CHECKSUM = 2
_SIGNATURE = 13
_SIGNED = 0x01
_LARGEST = 4096
"""Bytes kept at most while waiting for the rest of a packet."""


def signed(frame: bytes | bytearray) -> bool:
    """Whether a whole packet carries a signature."""
    return frame[0] == _V2 and bool(frame[2] & _SIGNED)


def senders(content: bytes) -> set[tuple[int, int]] | None:
    """Systems and components whose packets a datagram holds; None if it holds anything else."""
    found, rest = set(), bytearray(content)
    while rest:
        length = _length(rest) if rest[0] in _HEADER else None
        if length is None or len(rest) < length:
            return None
        ids = _SYSTEM[rest[0]]
        found.add((rest[ids], rest[ids + 1]))
        del rest[:length]
    return found


class Framer:
    """Extractor of packets from bytes.

    `decode` turns a packet whose message id is among `wanted`, which may grow, into a message, or
    returns None if it is none after all, in which case the search goes on behind its first byte.
    Packets of systems that are `foreign` are of no interest.
    """

    def __init__(
        self,
        wanted: Container[int],
        decode: Callable[[bytearray], object],
        foreign: Callable[[int], bool] = lambda _: False,
    ) -> None:
        self._wanted = wanted
        self._decode = decode
        self._foreign = foreign
        self._buffer = bytearray()
        self.damaged = 0
        """Discarded bytes and packets."""

    def feed(self, content: bytes) -> Iterator[object]:
        """Process bytes, and yield the messages that they complete."""
        buffer = self._buffer
        buffer += content
        while (start := _next_mark(buffer)) is not None:
            if start:
                self.damaged += 1
                del buffer[:start]
            length = _length(buffer)
            if length is None or len(buffer) < length:
                break
            if _message_id(buffer) not in self._wanted or self._foreign(_system(buffer)):
                # Only a packet is followed by a packet: a sufficient test without decoding.
                whole = len(buffer) == length or buffer[length] in _HEADER
                self.damaged += not whole
                del buffer[: length if whole else 1]
                continue
            message = self._decode(bytearray(buffer[:length]))
            self.damaged += message is None
            del buffer[: 1 if message is None else length]
            if message is not None:
                yield message
        if len(buffer) > _LARGEST or _next_mark(buffer) is None:
            buffer.clear()

    def flush(self) -> None:
        """Forget the beginning of a packet: the next bytes are of another sender."""
        self._buffer.clear()


def _next_mark(buffer: bytearray) -> int | None:
    places = [place for place in map(buffer.find, _MARKS) if place >= 0]
    return min(places, default=None)


def _length(buffer: bytearray) -> int | None:
    """Bytes of the packet that begins here; None while its header is not there yet."""
    version = buffer[0]
    header = _HEADER[version]
    if len(buffer) < header:
        return None
    tail = _SIGNATURE if version == _V2 and buffer[2] & _SIGNED else 0
    return header + buffer[1] + _CHECKSUM + tail


def _system(buffer: bytearray) -> int:
    return buffer[_SYSTEM[buffer[0]]]


def _message_id(buffer: bytearray) -> int:
    if buffer[0] == _V1:
        return buffer[5]
    return buffer[7] | buffer[8] << 8 | buffer[9] << 16
