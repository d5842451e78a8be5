"""GeoJSON (RFC 7946): polygons of features, collections and bare geometries."""

from __future__ import annotations

from typing import Any

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.formats.rings import AreaReader

__all__ = ["parse_geojson"]

_WGS84 = ("CRS84", "EPSG::4326", "EPSG:4326")


def parse_geojson(content: object, reader: AreaReader) -> None:
    """Hand the polygons of parsed GeoJSON to `reader`.

    Args:
        content: Parsed JSON.
        reader: Receives the polygons with their names, and counts other shapes.

    Raises:
        ConfigError: If it is no GeoJSON, or in other coordinates than WGS84's.
    """
    root = _object(content)
    _check_crs(root.get("crs"))
    # No recursion: the text's depth is bounded, and this stays so.
    waiting: list[tuple[object, object]] = [(root, None)]
    while waiting:
        value, named = waiting.pop()
        one = _object(value)
        kind = one.get("type")
        if kind == "FeatureCollection":
            waiting += [(entry, None) for entry in reversed(_list(one, "features"))]
        elif kind == "Feature":
            properties = one.get("properties")
            title = properties.get("name") if isinstance(properties, dict) else None
            if one.get("geometry") is not None:
                waiting.append((one["geometry"], title))
        elif kind == "GeometryCollection":
            waiting += [(entry, named) for entry in reversed(_list(one, "geometries"))]
        elif kind == "Polygon":
            reader.add(named, _rings(_list(one, "coordinates")))
        elif kind == "MultiPolygon":
            for polygon in _list(one, "coordinates"):
                reader.add(named, _rings(polygon))
        elif isinstance(kind, str):
            reader.others[kind[:40]] += 1
        else:
            raise ConfigError("it is no GeoJSON: an object has no type")


def _check_crs(crs: object) -> None:
    """Refuse other coordinates than WGS84's, which files before RFC 7946 could name."""
    if crs is None:
        return
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not str(name).endswith(_WGS84):
        raise ConfigError(f"its coordinates are of {str(name)[:40]!r}: export them as WGS84")


def _object(value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ConfigError("it is no GeoJSON: an object is missing")
    return value


def _list(value: dict[str, Any], key: str) -> list[Any]:
    entries = value.get(key)
    if not isinstance(entries, list):
        raise ConfigError(f"it is no GeoJSON: {key} must be a list")
    return entries


def _rings(value: object) -> list[list[list[Any]]]:
    if not isinstance(value, list) or not all(isinstance(ring, list) for ring in value):
        raise ConfigError("it is no GeoJSON: a polygon must be a list of rings")
    if not all(isinstance(at, list) for ring in value for at in ring):
        raise ConfigError("it is no GeoJSON: a corner must be longitude and latitude")
    return value
