"""Areas to cover or to avoid, from KML and GeoJSON."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.formats.geojson import parse_geojson
from aerodaas.extensions.plans.formats.kml import parse_kml
from aerodaas.extensions.plans.formats.numbers import LatLon
from aerodaas.extensions.plans.formats.rings import AreaReader
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.text.json_text import parse_json, read_text
from aerodaas.text.printable import printable

__all__ = ["Area", "read_areas"]


@dataclass(frozen=True)
class Area:
    """An area on the globe: degrees."""

    name: str
    outline: tuple[LatLon, ...]
    """Corners, the first not repeated at the end."""
    holes: tuple[tuple[LatLon, ...], ...] = ()

    def local(
        self, home: GeodeticOrigin
    ) -> tuple[list[tuple[float, float]], list[list[tuple[float, float]]]]:
        """Outline and holes in metres east and north of `home`, as `cover` takes them."""
        outline, *holes = [
            [
                (float(east), float(north))
                for east, north, _ in (home.to_local(*at, home.altitude) for at in ring)
            ]
            for ring in (self.outline, *self.holes)
        ]
        return outline, holes


def read_areas(path: str | Path) -> list[Area]:
    """Read the polygons of a KML or GeoJSON file; what is none of them is told by one warning.

    Raises:
        ConfigError: If it is neither, holds no polygon, or one that is malformed.
    """
    if Path(path).suffix.lower() == ".kmz":
        raise ConfigError(f"{path} is compressed: unpack it (it is a zip) and give the KML in it")
    text = read_text(path, "the areas").lstrip("\ufeff \t\r\n")
    reader = AreaReader()
    try:
        if text.startswith("<"):
            parse_kml(text, reader)
        else:
            parse_geojson(parse_json(text, "it"), reader)
    except ConfigError as error:
        raise ConfigError(f"{path} cannot be read as areas: {printable(str(error))}") from None
    if not reader.found:
        raise ConfigError(f"{path} holds no polygon; draw the area as one")
    _warn(path, reader.others)
    return [Area(name, rings[0], tuple(rings[1:])) for name, rings in reader.found]


def _warn(path: str | Path, others: Counter[str]) -> None:
    if others:
        listed = ", ".join(f"{count} {printable(kind)}" for kind, count in others.most_common(8))
        warnings.warn(f"{path}: only polygons are areas; left out: {listed}", stacklevel=3)
