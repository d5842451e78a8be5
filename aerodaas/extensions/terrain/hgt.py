"""SRTM's `.hgt` files: big-endian 16-bit metres, named by their south-western corner.

NASA SRTM Quick Start Guide (2013): one degree by one degree, 1201 or 3601 samples a side, whose
outer rows and columns are those of the neighbouring tiles; -32768 where nothing is known.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.errors import ConfigError
from aerodaas.terrain.tile import Grid, Tile

__all__ = ["hgt_tile"]

_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3})", re.IGNORECASE)
_SIDES = (1201, 3601)
"""Samples a side at 3 and at 1 arc second."""
_VOID = -32768


def hgt_tile(path: Path) -> Tile:
    """Describe a `.hgt` file; its samples are mapped into memory, not read.

    Raises:
        ConfigError: If its name says no corner, or its size is that of no tile.
    """
    found = _NAME.match(path.stem)
    if found is None:
        raise ConfigError(
            f"{path}: a .hgt file is named by its south-western corner, such as N47E008.hgt"
        )
    south = int(found[2]) * (1 if found[1].upper() == "N" else -1)
    west = int(found[4]) * (1 if found[3].upper() == "E" else -1)
    pole, date_line = 90, 180
    if not (-pole <= south < pole and -date_line <= west < date_line):
        raise ConfigError(f"{path}: {found[0]} is no place on Earth")
    size = path.stat().st_size
    side = next((side for side in _SIDES if 2 * side * side == size), None)
    if side is None:
        whole = " or ".join(f"{2 * side * side:,}" for side in _SIDES)
        raise ConfigError(
            f"{path}: {size:,} bytes are no whole tile, which has {whole}: fetch it again, unpacked"
        )
    step = 1.0 / (side - 1)

    def read() -> NDArray[Any]:
        return np.memmap(path, dtype=">i2", mode="r", shape=(side, side))

    return Tile(path, Grid(south + 1.0, float(west), step, step, side, side), read, _VOID)
