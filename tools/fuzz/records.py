"""Inputs that are a series of records: what it is, turns until the next one, and a body."""

from __future__ import annotations

import struct
from collections.abc import Iterator

__all__ = ["record", "records"]

_HEAD = struct.Struct(">BBH")
"""What it is, turns until the next one, length of its body."""


def records(data: bytes, longest: int) -> Iterator[tuple[int, int, bytes]]:
    """The records in any bytes; a body has its length modulo `longest`."""
    place = 0
    while len(data) - place >= _HEAD.size:
        kind, rest, length = _HEAD.unpack_from(data, place)
        place += _HEAD.size
        yield kind, rest, data[place : place + length % longest]
        place += length


def record(kind: int, rest: int, body: bytes) -> bytes:
    """One record."""
    return _HEAD.pack(kind, rest, len(body)) + body
