"""Codec of messages: pickle protocol 5 with the arrays out of band, so that none is copied.

Layout: u32 length of the envelope, u32 length of the item, u32 place of the first buffer; then the
envelope, the item, and each buffer, aligned to 64 bytes. Little-endian. Envelope and item are a
pickle each, so that the envelope can be read even if the item cannot. The envelope is a tuple of
plain values: the message's fields, the name of the item's class, and the place and length of each
buffer from the first on.

A class that other processes cannot import, such as one of the application's own file, travels by
value with each message that needs it. A process builds it once, so `isinstance` holds everywhere.
"""

from __future__ import annotations

import io
import pickle
import struct
from functools import lru_cache
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ray import cloudpickle

from aerodaas.errors import AeroDaaSError
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header
from aerodaas.runtime.sending import culprit

__all__ = ["Encoded", "UnreadableError", "UnsendableError", "decode", "encode"]

_PROTOCOL = 5
_ALIGNMENT = 64
_LENGTHS = struct.Struct("<III")
_LONGEST_IN_BAND = 256
"""Bytes of an array up to which it is part of the pickle: apart, it would cost several times as
much."""
_NUMBERS = f"?{np.typecodes['AllInteger']}{np.typecodes['AllFloat']}"
"""Codes of NumPy's numbers; arrays of anything else are pickled by NumPy."""


class UnsendableError(AeroDaaSError):
    """An item cannot be pickled; the text names the part."""


class UnreadableError(AeroDaaSError):
    """An item cannot be rebuilt here."""

    def __init__(self, message: Message[Any], kind: str, reason: str) -> None:
        """Create the error for an item of class `kind`; `message` is its envelope, empty."""
        super().__init__(f"{kind} from {message.stream}: {reason}")
        self.message = message


class Encoded:
    """A message ready to be written into a buffer of `size` bytes."""

    def __init__(self, message: Message[Any]) -> None:
        """Encode the message without copying its large arrays.

        Raises UnsendableError for an item that cannot be sent.
        """
        item, self._buffers = _pickled(message.item)
        self._places: list[int] = []
        """Where each buffer begins, from the first on."""
        length = 0
        for buffer in self._buffers:
            self._places.append(_aligned(length))
            length = self._places[-1] + buffer.nbytes
        envelope = pickle.dumps(
            (
                message.stream,
                message.seq,
                message.stamp,
                tuple(message.header),
                message.captured,
                tuple([tuple(span) for span in message.spans]),
                type(message.item).__name__,
                self._places,
                [buffer.nbytes for buffer in self._buffers],
            ),
            _PROTOCOL,
        )
        self._lengths = len(envelope), len(item)
        self._head = envelope + item
        self._start = _LENGTHS.size + len(self._head)
        if self._buffers:
            self._start = _aligned(self._start)
        self.size = self._start + length

    def write_into(self, target: memoryview) -> None:
        """Write all into `target`, memory of at least its size."""
        target[: _LENGTHS.size] = _LENGTHS.pack(*self._lengths, self._start)
        target[_LENGTHS.size : _LENGTHS.size + len(self._head)] = self._head
        for place, buffer in zip(self._places, self._buffers, strict=True):
            target[self._start + place : self._start + place + buffer.nbytes] = buffer

    def to_bytes(self, suffix: bytes = b"") -> bytes:
        """The encoded message as one bytes object, with `suffix` after it."""
        parts: list[bytes | memoryview] = [_LENGTHS.pack(*self._lengths, self._start), self._head]
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
    envelope_length, item_length, start = _LENGTHS.unpack_from(source)
    item = _LENGTHS.size + envelope_length
    stream, seq, stamp, header, captured, spans, kind, places, sizes = pickle.loads(  # noqa: S301 - our own bytes
        source[_LENGTHS.size : item]
    )
    told = tuple([TraceSpan._make(span) for span in spans])
    envelope = stream, seq, stamp, Header._make(header), captured, told
    begins = [start + place for place in places]
    buffers = [source[at : at + size] for at, size in zip(begins, sizes, strict=True)]
    try:
        return Message(*envelope, pickle.loads(source[item : item + item_length], buffers=buffers))  # noqa: S301 - our own
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise UnreadableError(Message(*envelope, None), kind, reason) from error


def _aligned(offset: int) -> int:
    return -(-offset // _ALIGNMENT) * _ALIGNMENT


def _pickled(item: object) -> tuple[bytes, list[memoryview]]:
    """Pickle of an item, and its large arrays. Raises UnsendableError."""
    try:
        return _pickled_by(_Pickler, item)
    except Exception:  # noqa: BLE001, S110 - the attempt below reports the reason
        pass
    try:
        return _pickled_by(_ValuePickler, item)
    except Exception as error:
        raise UnsendableError(culprit(item, error)) from error


def _pickled_by(pickler: Any, item: object) -> tuple[bytes, list[memoryview]]:  # noqa: ANN401 - a class
    file = io.BytesIO()
    buffers: list[pickle.PickleBuffer] = []
    pickler(file, _PROTOCOL, buffer_callback=buffers.append).dump(item)
    return file.getvalue(), [buffer.raw() for buffer in buffers]


class _Pickler(pickle.Pickler):
    """Pickler of items whose classes every process can import."""

    def reducer_override(self, obj: object) -> Any:  # noqa: ANN401 - pickle's
        if isinstance(obj, type | FunctionType) and obj.__module__ == "__main__":
            # By name, other processes would look for it in a `__main__` of their own.
            raise pickle.PicklingError
        return _reduced(obj) if type(obj) is np.ndarray else NotImplemented


class _ValuePickler(cloudpickle.Pickler):
    """Pickler of items with classes or functions that others cannot import."""

    def reducer_override(self, obj: Any) -> Any:  # noqa: ANN401 - pickle's
        if isinstance(obj, type):
            return _class, (_definition(obj),)
        known: Any = super()
        return _reduced(obj) if type(obj) is np.ndarray else known.reducer_override(obj)


def _reduced(array: NDArray[Any]) -> Any:  # noqa: ANN401 - pickle's
    """How an array is made: NumPy's own way says the same at several times the cost."""
    dtype, shape = array.dtype, array.shape
    code = dtype.char
    if code not in _NUMBERS or not dtype.isnative:
        return NotImplemented
    if array.nbytes <= _LONGEST_IN_BAND:
        return np.ndarray, (shape, code, array.tobytes())
    whole: Any = np.ascontiguousarray(array)
    return _array, (shape, code, pickle.PickleBuffer(whole))


def _array(shape: tuple[int, ...], code: str, content: memoryview) -> NDArray[Any]:
    # Not np.ndarray, which would keep the owner of all the memory instead of this view of it.
    array: NDArray[Any] = np.frombuffer(content, code).reshape(shape)
    return array


@lru_cache(maxsize=256)
def _definition(definition: type) -> bytes:
    """A class as cloudpickle sends it: by name if others can import it, else by value."""
    data: bytes = cloudpickle.dumps(definition, protocol=_PROTOCOL)  # pyright: ignore[reportPrivateImportUsage]
    return data


@lru_cache(maxsize=256)
def _class(definition: bytes) -> Any:  # noqa: ANN401 - a class
    # Once: cloudpickle returns the same class again, but sets all its attributes anew.
    return pickle.loads(definition)  # noqa: S301 - our own
