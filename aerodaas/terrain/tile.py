"""One elevation file: a regular grid of heights in latitude and longitude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_SAMPLES", "Grid", "Tile"]

MOST_SAMPLES = 30_000_000
"""Most samples of a file, or of an area cut out of several: 120 MB as 32-bit numbers."""
_HIGHEST, _DEEPEST = 9000.0, -500.0
"""Metres between which all land lies; what lies beyond is as good as a hole."""
_ALIGNED = 1e-3
"""Share of a step by which grids may be out of line: more than rounding in any file."""


@dataclass(frozen=True)
class Grid:
    """Where the samples of a tile lie: rows from north to south, columns from west to east."""

    north: float
    """Latitude of the first row, WGS84 degrees."""
    west: float
    """Longitude of the first column, WGS84 degrees."""
    latitude_step: float
    """Degrees between rows, positive."""
    longitude_step: float
    """Degrees between columns, positive."""
    rows: int
    columns: int

    @property
    def south(self) -> float:
        """Latitude of the last row."""
        return self.north - (self.rows - 1) * self.latitude_step

    @property
    def east(self) -> float:
        """Longitude of the last column."""
        return self.west + (self.columns - 1) * self.longitude_step

    def holds(self, latitude: float, longitude: float) -> bool:
        """Whether a place lies within the outer samples."""
        return self.south <= latitude <= self.north and self.west <= longitude <= self.east

    def is_aligned(self, other: Grid) -> bool:
        """Whether the samples of both are samples of one grid."""
        scale = max(self.rows, self.columns, other.rows, other.columns)
        for own, theirs, offset in (
            (self.latitude_step, other.latitude_step, self.north - other.north),
            (self.longitude_step, other.longitude_step, self.west - other.west),
        ):
            steps = offset / own
            if abs(own - theirs) * scale > _ALIGNED * own or abs(steps - round(steps)) > _ALIGNED:
                return False
        return True

    def offset(self, other: Grid) -> tuple[int, int]:
        """Row and column of this grid at which an aligned grid begins."""
        return (
            round((self.north - other.north) / self.latitude_step),
            round((other.west - self.west) / self.longitude_step),
        )


@dataclass(frozen=True, eq=False)
class Tile:
    """The heights of one file, above mean sea level, read when they are first asked for."""

    path: Path
    grid: Grid
    read: Callable[[], NDArray[Any]]
    """Reads the samples, shape (rows, columns); a memory map where the format allows it."""
    void: float | None
    """The sample that means that nothing is known, if the file says one."""

    @property
    def name(self) -> str:
        """The file's, without its folder."""
        return self.path.name

    @cached_property
    def _samples(self) -> NDArray[Any]:
        return self.read()

    def window(self, rows: slice, columns: slice) -> NDArray[np.float32]:
        """Heights of a part in metres; NaN where nothing is known."""
        part = np.asarray(self._samples[rows, columns])
        heights = part.astype(np.float32)
        unknown = ~((heights >= _DEEPEST) & (heights <= _HIGHEST))
        heights[unknown if self.void is None else unknown | (part == self.void)] = np.nan
        return heights
