"""QGroundControl's structure scan, which a plan stores as an outline, as the items that it means.

The items are those that QGroundControl sends to an autopilot: rounds at the distance of the scan,
one for each layer, from an entrance to which they come back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.commands import (
    DO_SET_CAM_TRIGG_DIST,
    DO_SET_ROI_NONE,
    DO_SET_ROI_WPNEXT_OFFSET,
    FRAME_MISSION,
    FRAME_RELATIVE,
    NAV_WAYPOINT,
)
from aerodaas.extensions.plans.formats.numbers import LatLon, finite, place
from aerodaas.extensions.plans.plan import MOST_ITEMS, PlanItem
from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["structure_scan"]

_VERSION = 3
_CORNERS = 3
_MITRE = 10.0
"""How far the corner of a round may lie out, as a multiple of the distance."""
_MOST_LAYERS = 200
_MOST_CORNERS = 500
_MOST_DISTANCE = 1000.0
"""Metres between structure and drone."""


def structure_scan(item: dict[str, Any], number: int) -> Iterator[PlanItem]:
    """Yield the items of a scan.

    Args:
        item: QGroundControl's complex item.
        number: Number of the first item.

    Raises:
        ConfigError: If its version is not 3, or its outline or distances cannot be flown.
    """
    where = f"item {number} (StructureScan)"
    if item.get("version") != _VERSION:
        raise ConfigError(
            f"{where} is not of version 3: open it in a current QGroundControl and save it again"
        )
    camera = item.get("CameraCalc")
    if not isinstance(camera, dict):
        raise ConfigError(f"{where}: CameraCalc must be an object")
    distance = _positive(camera, "DistanceToSurface", where)
    if distance > _MOST_DISTANCE:
        raise ConfigError(f"{where}: DistanceToSurface must be at most {_MOST_DISTANCE:g} m")
    layer = _positive(camera, "AdjustedFootprintFrontal", where)
    aside = _positive(camera, "AdjustedFootprintSide", where)
    layers = round(_positive(item, "Layers", where))
    if not 1 <= layers <= _MOST_LAYERS:
        raise ConfigError(f"{where}: Layers must be 1 to {_MOST_LAYERS}")
    from_top = item.get("StartFromTop") is True
    start = finite(item.get("StructureHeight" if from_top else "ScanBottomAlt"), f"{where}: height")
    step = -layer if from_top else layer
    entrance = finite(item.get("EntranceAltitude"), f"{where}: EntranceAltitude")
    ring = _round(_outline(item.get("polygon"), where), distance, where)
    if layers * len(ring) > MOST_ITEMS:
        raise ConfigError(f"{where} has more than {MOST_ITEMS} waypoints: scan fewer layers")
    steps: list[tuple[int, tuple[LatLon, float] | None, float]] = [
        (NAV_WAYPOINT, (ring[0], entrance), 0.0),
        (DO_SET_ROI_WPNEXT_OFFSET, None, 0.0),
    ]
    for index in range(layers):
        height = start + step * (index + 0.5)
        first, *others = [(NAV_WAYPOINT, (corner, height), 0.0) for corner in (*ring, ring[0])]
        steps += [first, (DO_SET_CAM_TRIGG_DIST, None, aside), *others]
        steps.append((DO_SET_CAM_TRIGG_DIST, None, 0.0))
    steps += [(DO_SET_ROI_NONE, None, 0.0), (NAV_WAYPOINT, (ring[0], entrance), 0.0)]
    for place_in_plan, (command, at, value) in enumerate(steps, start=number):
        if at is None:
            values = (value, 0.0, 0.0, 0.0)
            yield PlanItem(place_in_plan, command, FRAME_MISSION, values, 0.0, 0.0, 0.0)
        else:
            (latitude, longitude), height = at
            still = (0.0, 0.0, 0.0, None)
            yield PlanItem(
                place_in_plan, command, FRAME_RELATIVE, still, latitude, longitude, height
            )


def _positive(content: dict[str, Any], name: str, where: str) -> float:
    value = finite(content.get(name), f"{where}: {name}")
    if value <= 0.0:
        raise ConfigError(f"{where}: {name} must be positive, not {value:g}")
    return value


def _outline(value: object, where: str) -> list[LatLon]:
    if not isinstance(value, list) or not _CORNERS <= len(value) <= _MOST_CORNERS:
        raise ConfigError(f"{where}: polygon must have {_CORNERS} to {_MOST_CORNERS} corners")
    if not all(isinstance(corner, list) and len(corner) == 2 for corner in value):  # noqa: PLR2004
        raise ConfigError(f"{where}: a corner must be made of latitude and longitude")
    return [place(corner[0], corner[1], f"{where}: polygon") for corner in value]


def _round(outline: list[LatLon], distance: float, where: str) -> list[LatLon]:
    """Corners of the way around `outline` at `distance` metres, clockwise from its first corner."""
    origin = GeodeticOrigin(*outline[0])
    corners = [origin.to_local(*corner, 0.0)[:2] for corner in outline]
    structure = shapely.Polygon(corners)
    if not structure.is_valid or structure.area == 0.0:
        raise ConfigError(f"{where}: its outline encloses no area or crosses itself")
    around = structure.buffer(distance, join_style="mitre", mitre_limit=_MITRE)
    ring = np.array(orient(around, -1.0).exterior.coords)[:-1]
    nearest = int(np.argmin(np.linalg.norm(ring - corners[0], axis=1)))
    ring = np.roll(ring, -nearest, axis=0)
    places = [origin.to_geodetic(np.array([x, y, 0.0])) for x, y in ring]
    return [(latitude, longitude) for latitude, longitude, _ in places]
