"""A terrain model: heights above mean sea level from elevation files."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerodaas.config.extensions import extensions, imported
from aerodaas.errors import ConfigError
from aerodaas.terrain.tile import MOST_SAMPLES, Grid, Tile

__all__ = ["Patch", "Terrain"]


@dataclass(frozen=True, eq=False)
class Patch:
    """Heights of an area in memory; safe to ask at any rate."""

    grid: Grid
    samples: NDArray[np.float32]
    """Metres above mean sea level, shape (rows, columns); NaN where nothing is known."""

    def heights(
        self, latitudes: NDArray[np.float64], longitudes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Interpolate bilinearly, at places in degrees; NaN beside a hole and outside."""
        grid = self.grid
        rounding = 1e-6
        down = (grid.north - latitudes) / grid.latitude_step
        across = (longitudes - grid.west) / grid.longitude_step
        inside = (
            (down >= -rounding)
            & (down <= grid.rows - 1 + rounding)
            & (across >= -rounding)
            & (across <= grid.columns - 1 + rounding)
        )
        down = np.where(inside, np.clip(down, 0.0, grid.rows - 1), 0.0)
        across = np.where(inside, np.clip(across, 0.0, grid.columns - 1), 0.0)
        row = np.minimum(down.astype(np.intp), grid.rows - 2)
        column = np.minimum(across.astype(np.intp), grid.columns - 2)
        v, u = down - row, across - column
        heights = np.zeros_like(v)
        for rows, columns, weight in (
            (row, column, (1.0 - v) * (1.0 - u)),
            (row, column + 1, (1.0 - v) * u),
            (row + 1, column, v * (1.0 - u)),
            (row + 1, column + 1, v * u),
        ):
            # A sample without weight does not matter, not even as a hole.
            heights += np.where(weight > rounding, weight * self.samples[rows, columns], 0.0)
        return np.where(inside, heights, np.nan)


class Terrain:
    """Heights of the ground above mean sea level, from one or several elevation files.

    >>> Terrain.open(["N47E008.hgt"]).height(47.5, 8.5)  # doctest: +SKIP
    431.2
    """

    def __init__(self, tiles: Sequence[Tile]) -> None:
        """Join tiles, of which later ones fill the holes of earlier ones.

        Raises ConfigError if their samples are not those of one grid.
        """
        if not tiles:
            raise ConfigError("a terrain needs at least one file")
        self.tiles = tuple(tiles)
        for tile in tiles[1:]:
            if not tiles[0].grid.is_aligned(tile.grid):
                raise ConfigError(
                    f"{_gridded(tiles[0])} and {_gridded(tile)} have different grids: name one of "
                    "them, or make one file of both by `gdalwarp -t_srs EPSG:4326`"
                )

    @classmethod
    def open(cls, files: Sequence[str | Path]) -> Terrain:
        """Open elevation files of the formats that extensions read.

        Only their headers are read.

        Raises:
            ConfigError: If one cannot be read, or they do not fit together; with the remedy.
        """
        return cls([_opened(Path(file)) for file in files])

    def height(self, latitude: float, longitude: float) -> float:
        """Metres above mean sea level of the ground at a place in WGS84 degrees.

        Raises:
            ConfigError: If it is not known, because the files have a hole there or do not reach it.
        """
        patch = self.patch(latitude, longitude, latitude, longitude)
        found = float(patch.heights(np.array([latitude]), np.array([longitude]))[0])
        if math.isnan(found):
            raise ConfigError(self.why_unknown(latitude, longitude))
        return found

    def why_unknown(self, latitude: float, longitude: float) -> str:
        """Say why the height at a place is not known."""
        where = f"the ground at {latitude:.5f}, {longitude:.5f}"
        for tile in self.tiles:
            if tile.grid.holds(latitude, longitude):
                return f"{where} is not known: {tile.name} has a hole there; fill it by another"
        names = ", ".join(tile.name for tile in self.tiles[:3])
        more = f" and {len(self.tiles) - 3} more" if len(self.tiles) > 3 else ""  # noqa: PLR2004
        return f"{where} is not known: {names}{more} do not reach it; name a file that does"

    def patch(self, south: float, west: float, north: float, east: float) -> Patch:
        """Cut out an area, with a sample around it; NaN where nothing is known.

        Raises:
            ConfigError: If it has more than `MOST_SAMPLES`.
        """
        whole = self.tiles[0].grid
        top = math.floor((whole.north - north) / whole.latitude_step) - 1
        bottom = math.ceil((whole.north - south) / whole.latitude_step) + 1
        left = math.floor((west - whole.west) / whole.longitude_step) - 1
        right = math.ceil((east - whole.west) / whole.longitude_step) + 1
        rows, columns = bottom - top + 1, right - left + 1
        if rows * columns > MOST_SAMPLES:
            raise ConfigError(
                f"an area of {rows} x {columns} samples is more than {MOST_SAMPLES:,} in all: "
                "lower limits.max_range, or take a terrain with larger steps"
            )
        grid = replace(
            whole,
            north=whole.north - top * whole.latitude_step,
            west=whole.west + left * whole.longitude_step,
            rows=rows,
            columns=columns,
        )
        samples = np.full((rows, columns), np.nan, dtype=np.float32)
        for tile in self.tiles:
            _copy(tile, grid, samples)
        return Patch(grid, samples)


def _gridded(tile: Tile) -> str:
    """A file with its folder and its steps."""
    steps = (tile.grid.latitude_step, tile.grid.longitude_step)
    return (
        f"{tile.path} (steps of {' x '.join(f'{3600 * step:.5g}' for step in steps)} arc seconds)"
    )


def _copy(tile: Tile, grid: Grid, samples: NDArray[np.float32]) -> None:
    """Put a tile's heights where nothing is known yet."""
    row, column = grid.offset(tile.grid)
    first_row, last_row = max(0, row), min(grid.rows, row + tile.grid.rows)
    first_column, last_column = max(0, column), min(grid.columns, column + tile.grid.columns)
    if first_row >= last_row or first_column >= last_column:
        return
    part = tile.window(
        slice(first_row - row, last_row - row),
        slice(first_column - column, last_column - column),
    )
    target = samples[first_row:last_row, first_column:last_column]
    np.copyto(target, part, where=np.isnan(target))


def _opened(path: Path) -> Tile:
    try:
        formats = {
            suffix: place
            for extension in extensions().values()
            for suffix, place in extension.elevation_formats.items()
        }
        place = formats.get(path.suffix.lower())
        if place is None:
            known = ", ".join(formats) or "no"
            raise ConfigError(f"{path}: a terrain is read from {known} files, unpacked")
        if not path.is_file():
            raise ConfigError(f"no terrain file lies at {path}; see `terrain.files`")
        read: Callable[[Path], Tile] = imported(place)
        return read(path)
    except OSError as error:
        raise ConfigError(f"cannot read the terrain file {path}: {error.strerror}") from None
