"""Elevation files for tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["hgt", "hilly", "write_geotiff"]

Heights = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""Metres above the sea at latitudes and longitudes."""


def hgt(folder: Path, name: str, heights: Heights, side: int = 1201) -> Path:
    """Write a whole `.hgt` tile; NaN becomes a hole."""
    sign_south, sign_west = name[0] == "S", name[3] == "W"
    south, west = int(name[1:3]), int(name[4:7])
    south, west = -south if sign_south else south, -west if sign_west else west
    latitudes = south + 1.0 - np.arange(side)[:, None] / (side - 1)
    longitudes = west + np.arange(side)[None, :] / (side - 1)
    found = heights(*np.broadcast_arrays(latitudes, longitudes))
    path = folder / f"{name}.hgt"
    path.write_bytes(np.where(np.isnan(found), -32768, np.rint(found)).astype(">i2").tobytes())
    return path


def write_geotiff(
    path: Path,
    samples: NDArray[Any],
    north: float,
    west: float,
    step: float,
    *,
    point: bool = False,
    keys: dict[int, int] | None = None,
    nodata: str | None = None,
    gdal: str | None = None,
    **words: Any,  # noqa: ANN401
) -> Path:
    """Write a GeoTIFF whose first pixel's corner (or, with `point`, middle) is north-west.

    `gdal` are the items of GDAL's metadata.
    """
    import tifffile  # noqa: PLC0415 - an extra

    named = {1024: 2, 1025: 2 if point else 1, 2048: 4326, **(keys or {})}
    directory = [1, 1, 1, len(named)]
    for key in sorted(named):
        directory += [key, 0, 1, named[key]]
    tags: list[tuple[int, int, int, Any, bool]] = [
        (33550, 12, 3, (step, step, 0.0), True),
        (33922, 12, 6, (0.0, 0.0, 0.0, west, north, 0.0), True),
        (34735, 3, len(directory), tuple(directory), True),
    ]
    if nodata is not None:
        tags.append((42113, 2, 0, nodata, True))
    if gdal is not None:
        tags.append((42112, 2, 0, f"<GDALMetadata>{gdal}</GDALMetadata>", True))
    tifffile.imwrite(path, samples, extratags=tags, metadata=None, **words)
    return path


def hilly(latitudes: NDArray[np.float64], longitudes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Hills 40 m high, 540 m above the sea around 47 N, 8 E."""
    return 540.0 + 40.0 * np.sin(900.0 * (longitudes - 8.0)) * np.cos(700.0 * (latitudes - 47.0))
