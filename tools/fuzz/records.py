"""Inputs that are a series of records: what it is, turns until the next one, and a body.

Two bits of what it is mean the same everywhere, EARLY and QUIET.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterator
from itertools import takewhile

__all__ = ["EARLY", "LONGEST_REST", "QUIET", "early", "record", "records"]

EARLY = 0x40
"""Bit of the first records: heard while the driver connects and takes off, one each turn."""
QUIET = 0x80
"""Bit of a record: the vehicle itself says nothing until the next one."""
LONGEST_REST = 40
"""Most turns until the next record, whatever is said."""

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


def early(found: list[tuple[int, int, bytes]]) -> deque[tuple[int, int, bytes]]:
    """Those of the first records that are heard while the driver connects and takes off."""
    return deque(takewhile(lambda one: one[0] & EARLY, found))


def record(kind: int, rest: int, body: bytes) -> bytes:
    """One record."""
    return _HEAD.pack(kind, rest, len(body)) + body
