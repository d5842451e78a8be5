"""Mutations of bytes: small damage that keeps most of a valid input."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable, Sequence

__all__ = ["LARGEST", "mutated"]

LARGEST = 2**18
"""Bytes of the largest input that is made."""
_LARGEST_BLOCK = 64
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
_INTEGERS = (0, 1, -1, 7, 8, 127, 128, 255, 256, 32767, 32768, 65535, 65536)
_LONG_INTEGERS = (2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**63 - 1, 2**63, 2**64 - 1)
_TOKENS = (
    *(b"NaN", b"Infinity", b"-Infinity", b"1e400", b"-0.0", b"1e-400", b"9" * 400, b"null"),
    *(b"true", b"{}", b"[]", b'""', b'"\\ud800"', b"\x00", b"\xff\xfe", b"\xef\xbb\xbf"),
    *(b"\xed\xa0\x80", b"\r\n", b"\n", b",", b";", b":", b"<", b">", b"&", b'"', b"'", b"%s"),
    *(b"../", b"[" * 2000, b'{"a":' * 2000, b"<a>" * 2000),
)

_Mutation = Callable[[bytearray, Sequence[bytes], random.Random], None]


def mutated(data: bytes, pool: Sequence[bytes], rng: random.Random) -> bytes:
    """`data` with one to eight kinds of damage, at most LARGEST bytes long.

    Args:
        data: A valid input, or one that was valid once.
        pool: Other inputs, from which parts are taken.
        rng: Decides what is done where.
    """
    changed = bytearray(data)
    for _ in range(1 << rng.randrange(4)):
        rng.choice(_MUTATIONS)(changed, pool, rng)
    return bytes(changed[:LARGEST])


def _place(data: bytearray, rng: random.Random) -> int:
    return rng.randrange(len(data) + 1)


def _block(data: bytearray, rng: random.Random) -> tuple[int, int]:
    """A stretch of the data: mostly short, now and then of any length."""
    start = _place(data, rng)
    longest = _LARGEST_BLOCK if rng.random() < 0.9 else len(data)  # noqa: PLR2004 - nine in ten
    return start, min(len(data), start + 1 + rng.randrange(max(1, longest)))


def _flip_bit(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _set_byte(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    if data:
        data[rng.randrange(len(data))] = rng.randrange(256)


def _insert(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    place = _place(data, rng)
    data[place:place] = rng.randbytes(1 + rng.randrange(8))


def _delete(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    start, stop = _block(data, rng)
    del data[start:stop]


def _duplicate(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    start, stop = _block(data, rng)
    times = 1 if rng.random() < 0.9 else rng.randrange(2, 64)  # noqa: PLR2004 - nine in ten
    data[stop:stop] = (data[start:stop] * times)[:LARGEST]


def _move(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    start, stop = _block(data, rng)
    block = data[start:stop]
    del data[start:stop]
    place = _place(data, rng)
    data[place:place] = block


def _truncate(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    del data[_place(data, rng) :]


def _splice(data: bytearray, pool: Sequence[bytes], rng: random.Random) -> None:
    """Put a stretch of another input over, or in between."""
    other = bytearray(rng.choice(pool)) if pool else bytearray()
    start, stop = _block(other, rng)
    place = _place(data, rng)
    over = stop - start if rng.random() < 0.5 else 0  # noqa: PLR2004 - one in two
    data[place : place + over] = other[start:stop]


def _integer(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    """Overwrite with a number at a type's limit, of one to eight bytes in either order."""
    size, code = rng.choice(((1, "B"), (2, "H"), (4, "I"), (8, "Q")))
    value = rng.choice((*_INTEGERS, *_LONG_INTEGERS)) % (1 << 8 * size)
    place = _place(data, rng)
    data[place : place + size] = struct.pack(rng.choice("<>") + code, value)


def _float(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    value = rng.choice((float("nan"), float("inf"), -float("inf"), 0.0, -0.0, 1e38, -1e38, 1e-42))
    size, code = rng.choice(((4, "f"), (8, "d")))
    place = _place(data, rng)
    data[place : place + size] = struct.pack(rng.choice("<>") + code, value)


def _token(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    place = _place(data, rng)
    token = rng.choice(_TOKENS)
    data[place : place + rng.choice((0, len(token)))] = token


def _number_in_text(data: bytearray, _: Sequence[bytes], rng: random.Random) -> None:
    """Replace a decimal number by another token."""
    numbers = list(_NUMBER.finditer(bytes(data[:LARGEST])))
    if numbers:
        start, stop = rng.choice(numbers).span()
        numeral = str(rng.choice((*_INTEGERS, *_LONG_INTEGERS))).encode()
        data[start:stop] = rng.choice((rng.choice(_TOKENS), numeral))


_MUTATIONS: tuple[_Mutation, ...] = (
    *(_flip_bit, _set_byte, _insert, _delete, _duplicate, _move, _truncate, _splice),
    *(_integer, _float, _token, _number_in_text),
)
