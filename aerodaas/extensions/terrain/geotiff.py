"""GeoTIFF elevation files in geographic coordinates (EPSG:4326).

Keys and tags by OGC GeoTIFF 1.1 (OGC 19-008r4); GDAL's `GDAL_NODATA` says what a hole is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

from numpy.typing import NDArray

from aerodaas.config.extras import require_extra
from aerodaas.errors import ConfigError
from aerodaas.terrain.tile import MOST_SAMPLES, Grid, Tile
from aerodaas.text.json_text import read_text
from aerodaas.text.printable import printable
from aerodaas.text.xml_text import XmlError, parse_xml

if TYPE_CHECKING:
    from tifffile import TiffPage

__all__ = ["geotiff_tile"]

_WGS84 = 4326
_ABOVE_SEA = (None, 3855, 5773, 5798, 5714)
"""Vertical datums: none said, EGM2008, EGM96, EGM84, mean sea level."""
_METRE = (None, 9001)
_METRES = ("", "m", "metre", "meter", "metres", "meters")
"""GDAL's words for the unit of heights in metres."""
_WRITE_METRES = "write metres by `gdal_calc`"
_MOST_ELEMENTS = 10_000
_PIXEL_IS_POINT = 2


def geotiff_tile(path: Path) -> Tile:
    """Describe a GeoTIFF; its samples are read when they are first asked for.

    Raises:
        ConfigError: If it cannot be read, is not in latitude and longitude, or its heights are not
            metres above the sea.
    """
    require_extra("terrain", "a GeoTIFF terrain")
    import tifffile  # noqa: PLC0415 - an extra

    try:
        with tifffile.TiffFile(path) as file:
            page = file.pages[0]
            grid, void = _described(page, path)
            _require_metres(page, path)
    except ConfigError:
        raise
    except Exception as error:  # noqa: BLE001 - a stranger's bytes may raise anything
        raise _unreadable(path, error) from None

    def read() -> NDArray[Any]:
        return _samples(path, grid)

    return Tile(path, grid, read, void)


def _samples(path: Path, grid: Grid) -> NDArray[Any]:
    import tifffile  # noqa: PLC0415 - an extra

    try:
        with tifffile.TiffFile(path) as file:
            page = file.pages[0]
            if page.is_memmappable:
                samples: NDArray[Any] = tifffile.memmap(path, page=0, mode="r")
            else:
                samples = page.asarray(maxworkers=1)
    except Exception as error:  # noqa: BLE001 - as above
        raise _unreadable(path, error) from None
    if samples.shape != (grid.rows, grid.columns):
        raise ConfigError(f"{path}: its samples have the shape {samples.shape}: give another file")
    return samples


def _unreadable(path: Path, error: Exception) -> ConfigError:
    lines = str(error).splitlines() or [type(error).__name__]
    return ConfigError(
        f"{path} cannot be read as a GeoTIFF: {printable(lines[0])}: fetch it again, or write it "
        "anew by `gdal_translate`"
    )


def _described(page: TiffPage, path: Path) -> tuple[Grid, float | None]:
    """The grid, and the sample that stands for a hole."""
    if len(page.shape) != 2 or page.dtype is None or page.dtype.kind not in "iuf":  # noqa: PLR2004
        raise ConfigError(f"{path}: a terrain has one band of numbers, not {page.shape}")
    rows, columns = page.shape
    if not (rows >= 2 and columns >= 2 and rows * columns <= MOST_SAMPLES):  # noqa: PLR2004
        raise ConfigError(
            f"{path}: {rows} x {columns} samples; a terrain has 2 x 2 to {MOST_SAMPLES:,} in all: "
            "cut the area out by `gdalwarp -te`"
        )
    keys = _keys(page)
    _check(keys, path)
    north, west, latitude_step, longitude_step = _placed(page, path)
    if keys.get(1025) != _PIXEL_IS_POINT:
        # The tie point is the corner of a pixel, and the sample its middle.
        north, west = north - 0.5 * latitude_step, west + 0.5 * longitude_step
    grid = Grid(north, west, latitude_step, longitude_step, rows, columns)
    half_turn, step = 180.0, max(latitude_step, longitude_step)
    if not (
        abs(grid.north) <= half_turn / 2 + step
        and abs(grid.south) <= half_turn / 2 + step
        and abs(grid.west) <= half_turn + step
        and abs(grid.east) <= half_turn + step
    ):
        raise ConfigError(f"{path}: its corners are no latitudes and longitudes: give another file")
    void = _void(page, path)
    _check_whole(page, path, void)
    return grid, void


def _check_whole(page: TiffPage, path: Path, void: float | None) -> None:
    """Refuse a file without a part of its samples, which would be read as zeros."""
    ends = [start + size for start, size in zip(page.dataoffsets, page.databytecounts, strict=True)]
    if max(ends, default=0) > path.stat().st_size:
        raise ConfigError(f"{path} is cut short: fetch it again")
    if void is None and (not ends or 0 in page.databytecounts):
        raise ConfigError(
            f"{path} has parts without samples, and does not say what a hole is: write it anew by "
            "`gdal_translate -a_nodata -32768`"
        )


def _check(keys: Mapping[int, int], path: Path) -> None:
    """Refuse coordinates that are not WGS84 degrees, and heights that are not above the sea."""
    if 3072 in keys or keys.get(2048) != _WGS84:  # noqa: PLR2004 - ProjectedCRSGeoKey
        named = keys.get(3072) or keys.get(2048)
        said = f"EPSG:{named}" if named else "not named"
        raise ConfigError(
            f"{path}: its coordinates are {said}, and a terrain has EPSG:4326: convert it by "
            "`gdalwarp -t_srs EPSG:4326`"
        )
    if keys.get(4096) not in _ABOVE_SEA:
        raise ConfigError(
            f"{path}: its heights have the datum EPSG:{keys[4096]}, and a terrain's are above the "
            "sea (EGM96 or EGM2008): convert it by `gdalwarp -t_srs EPSG:4326+5773`"
        )
    if keys.get(4099) not in _METRE:
        raise ConfigError(f"{path}: its heights are not in metres: convert it by `gdal_calc`")


def _require_metres(page: TiffPage, path: Path) -> None:
    """Refuse heights in another unit, or scaled.

    GDAL's own words: UNITTYPE, SCALE and OFFSET in the file or, where it could not be written, in
    one beside it.
    """
    tag, beside = page.tags.get(42112), path.with_name(f"{path.name}.aux.xml")
    words: dict[str, str] = {}
    try:
        if beside.is_file():
            text = read_text(beside, "what GDAL says of a terrain")
            words = _words(parse_xml(text, "GDAL's metadata", _MOST_ELEMENTS))
        if tag is not None:
            words |= _words(parse_xml(str(tag.value).strip("\0 "), "GDAL_METADATA", _MOST_ELEMENTS))
        scaled = float(words.get("SCALE", 1.0)) != 1.0 or float(words.get("OFFSET", 0.0)) != 0.0
    except XmlError as error:
        raise ConfigError(f"{path}: GDAL's words for it {error}: {_WRITE_METRES}") from None
    except ValueError:
        scaled = True
    if scaled or words.get("UNITTYPE", "").strip().lower() not in _METRES:
        told = ", ".join(f"{name} {printable(word)[:20]}" for name, word in words.items())
        raise ConfigError(f"{path}: its heights are not in metres ({told}): {_WRITE_METRES}")


def _words(root: ET.Element) -> dict[str, str]:
    """GDAL's words for the first band, by its names for them in a GeoTIFF."""
    words = {}
    for item in root.iter("Item"):
        if item.get("sample", "0") == "0" and item.get("name") in {"UNITTYPE", "SCALE", "OFFSET"}:
            words[str(item.get("name"))] = item.text or ""
    for band in root.iter("PAMRasterBand"):
        if band.get("band", "1") == "1":
            for name in ("UnitType", "Scale", "Offset"):
                words |= {name.upper(): item.text or "" for item in band.iter(name)}
    return words


def _keys(page: TiffPage) -> dict[int, int]:
    """Short values of the GeoKeyDirectoryTag."""
    tag = page.tags.get(34735)
    if tag is None:
        return {}
    values = list(tag.value)
    entries = zip(*(values[first::4] for first in range(4, 8)), strict=False)
    return {key: value for key, place, _, value in entries if place == 0}


def _placed(page: TiffPage, path: Path) -> tuple[float, float, float, float]:
    """Latitude and longitude of pixel (0, 0), and the steps."""
    scale, tie = page.tags.get(33550), page.tags.get(33922)
    if scale is None or tie is None:
        raise ConfigError(
            f"{path} does not say where it lies (ModelPixelScale and ModelTiepoint): write it anew "
            "by `gdalwarp -t_srs EPSG:4326`"
        )
    across, up = (float(value) for value in scale.value[:2])
    column, row, _, longitude, latitude = (float(value) for value in tie.value[:5])
    if not all(map(math.isfinite, (column, row, longitude, latitude))) or not (
        0.0 < across <= 1.0 and 0.0 < up <= 1.0
    ):
        raise ConfigError(f"{path}: steps of {across} and {up} degrees: give another file")
    return latitude + row * up, longitude - column * across, up, across


def _void(page: TiffPage, path: Path) -> float | None:
    tag = page.tags.get(42113)
    if tag is None:
        return None
    text = str(tag.value).strip("\0 ")
    try:
        return float(text) if text else None
    except ValueError:
        raise ConfigError(
            f"{path}: {printable(text[:20])!r} is no number for holes (GDAL_NODATA): give another"
        ) from None
