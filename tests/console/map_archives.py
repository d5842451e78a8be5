"""PMTiles archives for tests, written by the format's specification."""

from __future__ import annotations

import gzip
import struct
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

__all__ = ["LEVELS", "archive_bytes", "colour_of", "tiles_around", "write_archive"]

Tile = tuple[int, int, int]
"""Level, column and row."""
LEVELS = range(16, 22)
_KINDS = 4
"""Columns and rows after which the colours repeat themselves."""


def colour_of(tile: Tile) -> tuple[int, int, int]:
    """Red, green and blue of a tile's picture."""
    level, column, row = tile
    return 10 * level, 60 * (column % _KINDS), 60 * (row % _KINDS)


def tiles_around(latitude: float, longitude: float, reach: int = 6) -> list[Tile]:
    """The tiles within so many tiles of a place, of all levels."""
    found = []
    for level in LEVELS:
        count = 2**level
        lat = np.radians(latitude)
        column = int((longitude + 180) / 360 * count)
        row = int((1 - np.arcsinh(np.tan(lat)) / np.pi) / 2 * count)
        steps = range(-reach, reach + 1)
        found += [(level, column + across, row + down) for across in steps for down in steps]
    return found


def archive_bytes(tiles: Iterable[Tile], kind: int = 2) -> bytes:
    """An archive of these tiles, each of its colour; the header says that they are of a kind."""
    places: dict[tuple[int, int, int], tuple[int, int]] = {}
    data, entries = b"", []
    for number, tile in sorted((_number(tile), tile) for tile in tiles):
        colour = colour_of(tile)
        if colour not in places:
            picture = np.full((256, 256, 3), colour[::-1], np.uint8)
            png = cv2.imencode(".png", picture)[1].tobytes()
            places[colour] = len(data), len(png)
            data += png
        entries.append((number, *places[colour]))
    # The root has the leaves' places: one leaf for each few entries.
    leaves, root = b"", []
    for first in range(0, len(entries), 400):
        leaf = gzip.compress(_directory(entries[first : first + 400], runs=1))
        root.append((entries[first][0], len(leaves), len(leaf)))
        leaves += leaf
    packed = gzip.compress(_directory(root, runs=0))
    meta = gzip.compress(b"{}")
    at_meta = 127 + len(packed)
    at_leaves = at_meta + len(meta)
    at_data = at_leaves + len(leaves)
    head = struct.pack(
        "<7sB11Q6B4iB2i", b"PMTiles", 3, 127, len(packed), at_meta, len(meta), at_leaves,
        len(leaves), at_data, len(data), len(entries), len(entries), len(places),
        1, 2, 1, kind, LEVELS[0], LEVELS[-1], *(0,) * 4, LEVELS[0], 0, 0,
    )  # fmt: skip
    return head + packed + meta + leaves + data


def write_archive(path: Path, tiles: Iterable[Tile]) -> Path:
    """Write an archive into a file."""
    path.write_bytes(archive_bytes(tiles))
    return path


def _number(tile: Tile) -> int:
    """Of a tile: those of the coarser levels, and before it along its level's Hilbert curve."""
    level, x, y = tile
    along = 0
    for bit in reversed(range(level)):
        right, down = x >> bit & 1, y >> bit & 1
        along += (3 * right ^ down) << 2 * bit
        x, y = x & (1 << bit) - 1, y & (1 << bit) - 1
        if not down:
            if right:
                x, y = (1 << bit) - 1 - x, (1 << bit) - 1 - y
            x, y = y, x
    return int((4**level - 1) // 3) + along


def _directory(entries: list[tuple[int, int, int]], runs: int) -> bytes:
    numbers = [number for number, _, _ in entries]
    steps = [one - before for one, before in zip(numbers, [0, *numbers[:-1]], strict=True)]
    columns = [
        steps,
        [runs] * len(entries),
        [long for _, _, long in entries],
        [place + 1 for _, place, _ in entries],
    ]
    return _varint(len(entries)) + b"".join(_varint(one) for column in columns for one in column)


def _varint(number: int) -> bytes:
    parts = []
    while number > 0x7F:
        parts.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*parts, number])
