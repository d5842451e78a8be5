"""Codec of messages: plain values by `marshal`, large arrays out of band, so that none is copied.

Layout: u32 length of the head, u32 place of the first buffer, then the head, and each buffer,
aligned to 64 bytes. Little-endian. The head is of plain values only: the envelope, the name of the
item's class, the place and length of each buffer from the first on, the item's pickle, empty where
it is a plain value, and that value. So the envelope can be read even if the item cannot. Both ends
run one version of Python, as `marshal` needs and Ray requires of a cluster.
"""

from __future__ import annotations

import marshal
import pickle
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.actors.streams import definitions as _definitions
from aerodaas.actors.streams.plain import NotPlainError, Plain, flatten, rebuild
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header
from aerodaas.runtime.sending import culprit

__all__ = ["Encoded", "UnreadableError", "UnsendableError", "decode", "encode"]

_ALIGNMENT = 64
_LENGTHS = struct.Struct("<II")
_WITHOUT_REFERENCES = 2
"""Version of marshal's format that does not look for what occurs twice: little does, and to look
takes longer."""
_defined: set[str] = set()
"""Streams with items of classes that pickle cannot refer to by name."""


class UnsendableError(AeroDaaSError):
    """An item cannot be pickled; the text names the part."""


class UnreadableError(AeroDaaSError):
    """An item cannot be rebuilt here."""

    def __init__(self, message: Message[Any], kind: str, reason: str) -> None:
        """Create the error for an item of class `kind`; `message` is its envelope, empty."""
        super().__init__(f"{kind} from {message.stream}: {reason}")
        self.message = message


def _bytes_of(array: Any) -> memoryview:  # noqa: ANN401 - a contiguous array, a buffer for NumPy
    return pickle.PickleBuffer(array).raw()


def _address(array: NDArray[Any]) -> int:
    address: int = array.__array_interface__["data"][0]
    return address


def _aligned(offset: int) -> int:
    return -(-offset // _ALIGNMENT) * _ALIGNMENT


class Encoded:
    """A message ready to be written into a buffer of `size` bytes."""

    def __init__(self, message: Message[Any]) -> None:
        """Encode the message without copying its large arrays.

        Raises UnsendableError for an item that cannot be sent.
        """
        self._arrays: list[NDArray[Any]] = []
        pickled = b""
        try:
            plain = flatten(message.item, self._arrays)
            self._buffers = [_bytes_of(array) for array in self._arrays]
        except (NotPlainError, RecursionError):
            self._arrays, plain = [], None
            pickled, self._buffers = _pickled(message)
        self._places: list[int] = []
        """Where each buffer begins, from the first on."""
        end = 0
        for buffer in self._buffers:
            self._places.append(_aligned(end))
            end = self._places[-1] + buffer.nbytes
        places = [
            (place, one.nbytes) for place, one in zip(self._places, self._buffers, strict=True)
        ]
        self._head = _head(message, tuple(places), pickled, plain)
        self._start = _LENGTHS.size + len(self._head)
        if places:
            self._start = _aligned(self._start)
        self._length = end
        self.size = self._start + end

    def size_around(self, array: NDArray[np.uint8], room: int) -> int | None:
        """Return the size that it has in a buffer that holds `array` from byte `room` on.

        None if its first buffer does not begin with `array`, or the rest has not enough room.
        """
        if not self._arrays or _LENGTHS.size + len(self._head) > room:
            return None
        return room + self._length if _address(self._arrays[0]) == _address(array) else None

    def write_into(self, target: memoryview, room: int = 0) -> None:
        """Write all into `target`; not its first buffer, if that is there, from byte `room` on."""
        start = room or self._start
        target[: _LENGTHS.size] = _LENGTHS.pack(len(self._head), start)
        target[_LENGTHS.size : _LENGTHS.size + len(self._head)] = self._head
        for place, buffer in zip(self._places, self._buffers, strict=True):
            if place or not room:
                target[start + place : start + place + buffer.nbytes] = buffer

    def to_bytes(self, suffix: bytes = b"") -> bytes:
        """The encoded message as one bytes object, with `suffix` after it."""
        parts: list[bytes | memoryview] = [_LENGTHS.pack(len(self._head), self._start), self._head]
        end = _LENGTHS.size + len(self._head)
        for place, buffer in zip(self._places, self._buffers, strict=True):
            parts += bytes(self._start + place - end), buffer
            end = self._start + place + buffer.nbytes
        return b"".join((*parts, suffix))


def encode(message: Message[Any]) -> bytes:
    """Encode a message as one bytes object."""
    return Encoded(message).to_bytes()


def decode(source: memoryview) -> Message[Any]:
    """Rebuild a message; its arrays are read-only views into `source`, which they keep alive.

    Raises UnreadableError if its item cannot be rebuilt.
    """
    source = source.toreadonly()
    length, start = _LENGTHS.unpack_from(source)
    stream, seq, stamp, header, captured, spans, kind, places, pickled, plain = marshal.loads(  # noqa: S302 - our own bytes
        source[_LENGTHS.size : _LENGTHS.size + length]
    )
    buffers = [source[start + place : start + place + size] for place, size in places]
    envelope = stream, seq, stamp, Header._make(header), captured, _spans(spans)
    try:
        if pickled:
            return Message(*envelope, pickle.loads(pickled, buffers=buffers))  # noqa: S301 - our own
        return Message(*envelope, rebuild(plain, buffers))
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise UnreadableError(Message(*envelope, None), kind, reason) from error


def _spans(spans: tuple[tuple[str, int, int], ...]) -> tuple[TraceSpan, ...]:
    return tuple([TraceSpan._make(span) for span in spans])


def _head(
    message: Message[Any], places: tuple[tuple[int, int], ...], pickled: bytes, plain: Plain
) -> bytes:
    envelope: tuple[Any, ...] = (
        message.stream,
        message.seq,
        message.stamp,
        tuple(message.header),
        message.captured,
        tuple([tuple(span) for span in message.spans]),
        type(message.item).__name__,
    )
    return marshal.dumps((*envelope, places, pickled, plain), _WITHOUT_REFERENCES)


def _pickled(message: Message[Any]) -> tuple[bytes, list[memoryview]]:
    buffers: list[pickle.PickleBuffer] = []
    if message.stream not in _defined:
        try:
            data = pickle.dumps(message.item, protocol=5, buffer_callback=buffers.append)
            return data, [buffer.raw() for buffer in buffers]
        except Exception:  # noqa: BLE001 - the attempt below reports the reason
            buffers = []
    try:
        data = _definitions.pickled(message.item, buffers.append)
    except Exception as error:
        raise UnsendableError(culprit(message.item, error)) from error
    _defined.add(message.stream)
    return data, [buffer.raw() for buffer in buffers]
