"""Codec of messages: pickle 5 with large arrays out of band, so that a reader copies nothing.

Vectors of a few numbers are in the pickle itself: apart, each would cost several times as much.

Layout: u32 number of buffers, u32 length of the envelope, u32 length of the item's pickle, u64
length of each buffer, envelope, pickle, then each buffer, aligned to 64 bytes. Little-endian. The
envelope is separate so that it can be read even if the item cannot. It is of numbers and strings
only, which `marshal` writes and reads several times faster than pickle does its named tuples; both
ends run one version of Python, as Ray requires of a cluster.
"""

from __future__ import annotations

import copyreg
import io
import marshal
import pickle
import struct
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.actors.streams import definitions as _definitions
from aerodaas.actors.streams.pickling_errors import culprit
from aerodaas.types.data import Header
from aerodaas.types.errors import AeroDaaSError
from aerodaas.types.status import Message, TraceSpan

__all__ = ["Encoded", "UnreadableError", "UnsendableError", "decode", "encode"]

_ALIGNMENT = 64
_HEAD = struct.Struct("<III")
_FLOAT = np.dtype(np.float64)
_LONGEST_VECTOR = 256
"""Bytes up to which an array of one dimension of floats is in the pickle."""
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


def _aligned(offset: int) -> int:
    return -(-offset // _ALIGNMENT) * _ALIGNMENT


class Encoded:
    """A message ready to be written into a buffer of `size` bytes."""

    def __init__(self, message: Message[Any]) -> None:
        """Pickle the message without copying its arrays.

        Raises UnsendableError for an item that cannot be pickled.
        """
        item, buffers = _pickled(message)
        envelope = _envelope(message)
        self._buffers = [buffer.raw() for buffer in buffers]
        lengths = [buffer.nbytes for buffer in self._buffers]
        self._head = _HEAD.pack(len(lengths), len(envelope), len(item)) + struct.pack(
            f"<{len(lengths)}Q", *lengths
        )
        self._pickle = envelope + item
        self._offsets: list[int] = []
        end = len(self._head) + len(self._pickle)
        for length in lengths:
            start = _aligned(end)
            self._offsets.append(start)
            end = start + length
        self.size = end

    def write_into(self, target: memoryview) -> None:
        """Write all `size` bytes into `target`."""
        start = len(self._head)
        target[:start] = self._head
        target[start : start + len(self._pickle)] = self._pickle
        for offset, buffer in zip(self._offsets, self._buffers, strict=True):
            target[offset : offset + buffer.nbytes] = buffer

    def to_bytes(self, suffix: bytes = b"") -> bytes:
        """The encoded message as one bytes object, with `suffix` after it."""
        parts: list[bytes | memoryview] = [self._head, self._pickle]
        end = len(self._head) + len(self._pickle)
        for offset, buffer in zip(self._offsets, self._buffers, strict=True):
            parts += bytes(offset - end), buffer
            end = offset + buffer.nbytes
        return b"".join((*parts, suffix))


def encode(message: Message[Any]) -> bytes:
    """Encode a message as one bytes object."""
    return Encoded(message).to_bytes()


def decode(source: memoryview) -> Message[Any]:
    """Rebuild a message; its arrays are read-only views into `source`, which they keep alive.

    Raises UnreadableError if its item cannot be rebuilt.
    """
    source = source.toreadonly()
    count, first, second = _HEAD.unpack_from(source)
    lengths = struct.unpack_from(f"<{count}Q", source, _HEAD.size)
    start = _HEAD.size + 8 * count
    middle = start + first
    end = middle + second
    buffers = []
    cursor = end
    for length in lengths:
        cursor = _aligned(cursor)
        buffers.append(source[cursor : cursor + length])
        cursor += length
    stream, seq, stamp, header, captured, spans, kind = marshal.loads(source[start:middle])  # noqa: S302
    header, spans = Header._make(header), tuple(map(TraceSpan._make, spans))
    make: Callable[[Any], Message[Any]] = partial(
        Message, stream, seq, stamp, header, captured, spans
    )
    try:
        item = pickle.loads(source[middle:end], buffers=buffers)  # noqa: S301 - our own bytes
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise UnreadableError(make(None), kind, reason) from error
    return make(item)


def _envelope(message: Message[Any]) -> bytes:
    return marshal.dumps(
        (
            message.stream,
            message.seq,
            message.stamp,
            tuple(message.header),
            message.captured,
            tuple(map(tuple, message.spans)),
            type(message.item).__name__,
        )
    )


def _pickled(message: Message[Any]) -> tuple[bytes, list[pickle.PickleBuffer]]:
    buffers: list[pickle.PickleBuffer] = []
    if message.stream not in _defined:
        try:
            file = io.BytesIO()
            pickler = pickle.Pickler(file, protocol=5, buffer_callback=buffers.append)
            pickler.dispatch_table = {**copyreg.dispatch_table, np.ndarray: _reduced}
            pickler.dump(message.item)
            return file.getvalue(), buffers
        except Exception:  # noqa: BLE001 - the attempt below reports the reason
            buffers = []
    try:
        data = _definitions.pickled(message.item, buffers.append)
    except Exception as error:
        raise UnsendableError(culprit(message.item, error)) from error
    _defined.add(message.stream)
    return data, buffers


def _reduced(array: NDArray[Any]) -> Any:  # noqa: ANN401 - pickle's
    """Reduce an array for pickle: a short vector to its bytes, any other as NumPy does."""
    if array.ndim == 1 and array.dtype is _FLOAT and 0 < array.nbytes <= _LONGEST_VECTOR:
        return np.frombuffer, (array.tobytes(),)
    return array.__reduce_ex__(5)
