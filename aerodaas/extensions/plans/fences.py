"""A plan's geofence as that of an environment file."""

from __future__ import annotations

import math
from collections.abc import Sequence

from aerodaas.config.model import GeofenceConfig
from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.formats.numbers import LatLon
from aerodaas.extensions.plans.plan import FenceCircle, FencePolygon
from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["geofence_of"]

_CIRCLE_CORNERS = 64


def geofence_of(
    fence: Sequence[FencePolygon | FenceCircle], home: GeodeticOrigin
) -> GeofenceConfig:
    """Turn a plan's fence into a robot's `limits.geofence`, in metres of `home`.

    A circle becomes a polygon of 64 corners: within it where the drone stays in, around it where
    it stays out. Floor and ceiling, of which a plan has none, keep their defaults.

    Args:
        fence: Polygons and circles of the plan.
        home: Origin of the local frame.

    Raises:
        ConfigError: If there is more than one area to stay within.
    """
    within = [one for one in fence if one.inclusion]
    if len(within) > 1:
        raise ConfigError(
            f"the plan has {len(within)} areas to stay within, and a geofence has one: draw one "
            "polygon around them, and the rest as areas to stay out of"
        )
    return GeofenceConfig(
        polygon=_corners(within[0], home) if within else [],
        no_fly=[_corners(one, home) for one in fence if not one.inclusion],
    )


def _corners(area: FencePolygon | FenceCircle, home: GeodeticOrigin) -> list[tuple[float, float]]:
    if isinstance(area, FencePolygon):
        return [_local(corner, home) for corner in area.corners]
    east, north = _local(area.centre, home)
    reach = area.radius if area.inclusion else area.radius / math.cos(math.pi / _CIRCLE_CORNERS)
    angles = [math.tau * index / _CIRCLE_CORNERS for index in range(_CIRCLE_CORNERS)]
    return [(east + reach * math.cos(a), north + reach * math.sin(a)) for a in angles]


def _local(at: LatLon, home: GeodeticOrigin) -> tuple[float, float]:
    east, north, _ = home.to_local(*at, home.altitude)
    return float(east), float(north)
