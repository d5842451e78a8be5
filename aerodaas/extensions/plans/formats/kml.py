"""KML 2.2: polygons of placemarks. Nothing that it links to is fetched."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.etree import ElementTree as ET

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.formats.rings import AreaReader
from aerodaas.text.xml_text import XmlError, parse_xml

__all__ = ["parse_kml"]

_MOST_ELEMENTS = 200_000
_OTHERS = ("Point", "LineString", "Model", "Track", "NetworkLink", "GroundOverlay")
_BOUNDARIES = {"outerBoundaryIs": 0, "innerBoundaryIs": 1}
_LONGEST = 40
"""Most characters of a number."""
_WHOLE_DEGREES = re.compile(r"[+-]?\d{1,40},\d{1,40}")
"""A corner without a decimal point; as well a number with a decimal comma."""


def parse_kml(text: str, reader: AreaReader) -> None:
    """Hand the polygons of a KML text to `reader`.

    Args:
        text: Content of the file.
        reader: Receives the polygons with their names, and counts other shapes.

    Raises:
        ConfigError: If it is no KML, declares entities, or is nested too deep.
    """
    try:
        root = parse_xml(text, "KML", _MOST_ELEMENTS)
    except XmlError as error:
        raise ConfigError(f"it {error}") from None
    if _local(root) != "kml":
        raise ConfigError(f"it is XML of the kind {_local(root)[:40]!r}, not KML")
    for placemark in _all(root, "Placemark"):
        name = next((one.text for one in placemark if _local(one) == "name"), None)
        for polygon in _all(placemark, "Polygon"):
            reader.add(name, _rings(polygon))
    for one in root.iter():
        if _local(one) in _OTHERS:
            reader.others[_local(one)] += 1


def _rings(polygon: ET.Element) -> list[list[list[float]]]:
    """Outline, then holes."""
    rings = sorted(
        ((_BOUNDARIES[_local(one)], one) for one in polygon if _local(one) in _BOUNDARIES),
        key=lambda ring: ring[0],
    )
    if [order for order, _ in rings[:2]].count(0) != 1:
        raise ConfigError("a polygon must have one outerBoundaryIs")
    return [[*_corners(boundary)] for _, boundary in rings]


def _corners(boundary: ET.Element) -> Iterator[list[float]]:
    for coordinates in _all(boundary, "coordinates"):
        corners = (coordinates.text or "").split()
        if corners and all(map(_WHOLE_DEGREES.fullmatch, corners)):
            raise ConfigError(
                f"a corner is {corners[0][:_LONGEST]!r}: write decimals with a point, not a comma, "
                "and whole degrees with .0"
            )
        for corner in corners:
            yield [_number(field) for field in corner.split(",")]


def _number(text: str) -> float:
    try:
        if len(text) <= _LONGEST and "_" not in text:
            return float(text)
    except ValueError:
        pass
    raise ConfigError(f"a coordinate must be a number, not {text[:_LONGEST]!r}")


def _all(element: ET.Element, name: str) -> Iterator[ET.Element]:
    return (one for one in element.iter() if _local(one) == name)


def _local(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]
