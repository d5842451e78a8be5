"""Messages as bytes: pickle 5 with large arrays out of band, so that a reader copies nothing.

Layout: u32 number of buffers, u32 length of the pickle, u64 length of each buffer, the pickle,
then each buffer, aligned to 64 bytes. Little-endian, as both ends run the same host.
"""

from __future__ import annotations

import dataclasses
import pickle
import struct
from operator import attrgetter
from typing import Any

from aerodaas.status import Message

__all__ = ["Encoded", "decode", "encode"]

_fields = attrgetter(*(field.name for field in dataclasses.fields(Message)))
_ALIGNMENT = 64
_HEAD = struct.Struct("<II")


def _aligned(offset: int) -> int:
    return -(-offset // _ALIGNMENT) * _ALIGNMENT


class Encoded:
    """A message ready to be written into a buffer of `size` bytes."""

    def __init__(self, message: Message[Any]) -> None:
        """Pickle the message, leaving the memory of its arrays where it is."""
        buffers: list[pickle.PickleBuffer] = []
        self._pickle = pickle.dumps(_fields(message), protocol=5, buffer_callback=buffers.append)
        self._buffers = [buffer.raw() for buffer in buffers]
        lengths = [buffer.nbytes for buffer in self._buffers]
        self._head = _HEAD.pack(len(lengths), len(self._pickle)) + struct.pack(
            f"<{len(lengths)}Q", *lengths
        )
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

    def to_bytes(self) -> bytes:
        """All of it as one bytes object."""
        whole = bytearray(self.size)
        self.write_into(memoryview(whole))
        return bytes(whole)


def encode(message: Message[Any]) -> bytes:
    """The message as one bytes object."""
    return Encoded(message).to_bytes()


def decode(source: memoryview) -> Message[Any]:
    """Rebuild a message; its arrays are read-only views into `source`, which they keep alive."""
    source = source.toreadonly()
    count, pickled = _HEAD.unpack_from(source)
    lengths = struct.unpack_from(f"<{count}Q", source, _HEAD.size)
    start = _HEAD.size + 8 * count
    end = start + pickled
    buffers = []
    cursor = end
    for length in lengths:
        cursor = _aligned(cursor)
        buffers.append(source[cursor : cursor + length])
        cursor += length
    return Message(*pickle.loads(source[start:end], buffers=buffers))  # noqa: S301 - our own bytes
