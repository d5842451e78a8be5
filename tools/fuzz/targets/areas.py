"""Areas from KML and GeoJSON."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable

from aerodaas.errors import AeroDaaSError
from aerodaas.extensions.plans.areas import read_areas
from tools.fuzz.scratch import scratch_file

__all__ = ["run", "seeds"]

_FILE = scratch_file(".areas")


def seeds() -> Iterable[bytes]:
    """A field with a hole in each format, beside what is no area."""
    ring = [[8.0, 47.0], [8.002, 47.0], [8.002, 47.001], [8.0, 47.001], [8.0, 47.0]]
    hole = [[8.001, 47.0004], [8.0012, 47.0004], [8.0012, 47.0006], [8.001, 47.0004]]
    field = {"type": "Polygon", "coordinates": [ring, hole]}
    features = [
        {"type": "Feature", "properties": {"name": "field"}, "geometry": field},
        {"type": "Feature", "properties": None, "geometry": {"type": "Point"}},
        {"type": "MultiPolygon", "coordinates": [[ring], [hole]]},
        {"type": "GeometryCollection", "geometries": [field]},
    ]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    collection = {"type": "FeatureCollection", "crs": crs, "features": features}
    yield json.dumps(collection).encode()
    outer, inner = (
        " ".join(f"{east},{north},0" for east, north in corners) for corners in (ring, hole)
    )
    yield (
        '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark>'
        f"<name>field</name><Polygon><outerBoundaryIs><LinearRing><coordinates>{outer}"
        "</coordinates></LinearRing></outerBoundaryIs><innerBoundaryIs><LinearRing><coordinates>"
        f"{inner}</coordinates></LinearRing></innerBoundaryIs></Polygon></Placemark>"
        "<Placemark><Point><coordinates>8,47</coordinates></Point></Placemark></Document></kml>"
    ).encode()


def run(data: bytes) -> None:
    """Read one file; each area has corners on the globe."""
    _FILE.write_bytes(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            areas = read_areas(_FILE)
    except AeroDaaSError:
        return
    for area in areas:
        if len(area.outline) < 3 or not all(abs(north) <= 90.0 for north, _ in area.outline):  # noqa: PLR2004
            raise AssertionError(f"an area {area}")
