"""A time written into an image so that it survives encoding, to measure an image's age.

It needs numpy alone, so that clients of other libraries can load this file by its path.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["read_age", "write_stamp"]

_BITS, _CHECK = 32, 8
_CELL = 16
"""Pixels of one bit's square: a whole macroblock, which the encoder keeps."""
_STAMPS: int = 2**_BITS
_MASK: int = 2**_CHECK - 1
_MIDDLE = 128


def write_stamp(image: NDArray[np.uint8], milliseconds: int) -> None:
    """Write a time as black and white squares along the top of an image."""
    stamp = milliseconds % _STAMPS
    word = stamp << _CHECK | _checksum(stamp)
    for bit in range(_BITS + _CHECK):
        row, column = divmod(bit, image.shape[1] // _CELL)
        y, x = row * _CELL, column * _CELL
        lit = word >> (_BITS + _CHECK - 1 - bit) & 1
        image[y : y + _CELL, x : x + _CELL] = 255 * lit


def read_age(image: NDArray[np.uint8], milliseconds: int) -> float | None:
    """Milliseconds from the time in an image until now; None if it cannot be read."""
    word = 0
    for bit in range(_BITS + _CHECK):
        row, column = divmod(bit, image.shape[1] // _CELL)
        y, x = row * _CELL + _CELL // 4, column * _CELL + _CELL // 4
        lit = image[y : y + _CELL // 2, x : x + _CELL // 2].mean() > _MIDDLE
        word = word << 1 | int(lit)
    stamp, check = word >> _CHECK, word & _MASK
    return float((milliseconds - stamp) % _STAMPS) if check == _checksum(stamp) else None


def _checksum(stamp: int) -> int:
    # Not zero for a picture that is black.
    total: int = sum(stamp.to_bytes(_BITS // 8, "big")) * 37 + 90
    return total & _MASK
