"""Messages that end with an `uint8[]`, whose bytes stay bytes.

Cyclone's binding makes a list of integers of them: a picture of 1920 x 1080 would take 50 MB and
tens of times as long.
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Callable
from typing import Any

__all__ = ["data_last"]

_LITTLE = 1
"""Lowest bit of the second byte of CDR's header: little-endian."""
_ALIGNMENT = 4
"""Bytes that a sequence's length is aligned to; CDR's header, which does not count, is as long."""


def data_last(head_type: Any) -> Callable[[type], Any]:  # noqa: ANN401 - made by a metaclass
    """Decorator of an IdlStruct: its last field, `data`, is bytes, or whatever has a buffer.

    Args:
        head_type: The IdlStruct of all its fields but `data`.
    """
    names = [one.name for one in dataclasses.fields(head_type)]

    def serialize(message: Any, *_: object, **__: object) -> bytes:  # noqa: ANN401
        """Encode in CDR, little-endian."""
        head = head_type(*(getattr(message, name) for name in names))
        data = memoryview(message.data).cast("B")
        encoded: bytes = head.serialize(use_version_2=False)
        return b"".join((encoded, _padding(encoded), struct.pack("<I", len(data)), data))

    def deserialize(cls: type[Any], data: bytes, /, *_: object, **__: object) -> Any:  # noqa: ANN401
        """Decode CDR of either byte order; raises ValueError or struct.error if it is too short."""
        head = head_type.deserialize(data)
        encoded = head.serialize(use_version_2=False)
        start = len(encoded) + len(_padding(encoded)) + _ALIGNMENT
        (size,) = struct.unpack_from("<I" if data[1] & _LITTLE else ">I", data, start - _ALIGNMENT)
        if start + size > len(data):
            raise ValueError(f"{size} bytes are announced, and {len(data) - start} are there")
        fields = {name: getattr(head, name) for name in names}
        return cls(**fields, data=data[start : start + size])

    def decorate(cls: Any) -> Any:  # noqa: ANN401
        cls.serialize = serialize
        cls.deserialize = classmethod(deserialize)
        return cls

    return decorate


def _padding(encoded: bytes) -> bytes:
    return bytes(-len(encoded) % _ALIGNMENT)
