"""The geofence: an inclusion polygon, no-fly zones, a floor and a ceiling."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from aerodaas.config.model import GeofenceConfig
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import Vector, length

__all__ = ["Geofence"]


class Geofence:
    """The geofence of one drone, in ENU metres.

    `area` is where the drone may be, `inner` is `area` less the margin: targets lie in `inner`.
    Raises ConfigError for self-intersecting outlines and for a fence that its margin fills.
    """

    def __init__(self, config: GeofenceConfig, unknown: BaseGeometry | None = None) -> None:
        """Build the polygons; nothing flies over `unknown` ground."""
        self._unknown = unknown
        self.floor = config.floor
        self.ceiling = config.ceiling
        self.margin = config.margin
        self.area: BaseGeometry | None = None
        self.inner: BaseGeometry | None = None
        self._starts: NDArray[np.float64] = np.empty((0, 2))
        self._along: NDArray[np.float64] = np.empty((0, 2))
        """From each edge's start to its end."""
        self._squared: NDArray[np.float64] = np.empty(0)
        """Their lengths squared; 1 for an edge without length."""
        if not (config.polygon or config.no_fly or unknown is not None):
            return
        unbounded = 1e6
        area: BaseGeometry = (
            _polygon(config.polygon, "polygon")
            if config.polygon
            else shapely.box(-unbounded, -unbounded, unbounded, unbounded)
        )
        for number, outline in enumerate(config.no_fly):
            area = area.difference(_polygon(outline, f"no_fly.{number}"))
        if unknown is not None:
            area = area.difference(unknown)
        inner = area.buffer(-config.margin, join_style="mitre")
        if inner.is_empty:
            raise ConfigError(
                f"the geofence leaves no room within its margin of {config.margin} m; "
                "make it larger or the margin smaller"
            )
        shapely.prepare(area)
        shapely.prepare(inner)
        self.area, self.inner = area, inner
        edges = [
            (ring[:-1], ring[1:])
            for part in shapely.get_parts(area)
            for ring in (shapely.get_coordinates(r) for r in (part.exterior, *part.interiors))
        ]
        self._starts = np.concatenate([start for start, _ in edges])
        self._along = np.concatenate([end for _, end in edges]) - self._starts
        squared = np.einsum("ij,ij->i", self._along, self._along)
        self._squared = np.where(squared, squared, 1)

    def contains(self, position: Vector) -> bool:
        """Return whether the drone may be at `position`."""
        return not self.objection(position)

    def objection(self, position: Vector) -> str:
        """Return why `position` is not a permitted target, or an empty string."""
        east, north, up = (float(axis) for axis in position)
        if up < self.floor:
            return f"{up:.2f} m is under the floor of {self.floor:g} m (limits.geofence.floor)"
        if up > self.ceiling:
            ceiling = f"{self.ceiling:g} m (limits.geofence.ceiling)"
            return f"{up:.2f} m is above the ceiling of {ceiling}"
        if self.area is None or self.inner is None:
            return ""
        place = shapely.Point(east, north)
        if not shapely.covers(self.area, place):
            distance = shapely.distance(self.area, place)
            return (
                f"({east:.1f}, {north:.1f}) lies over ground that the terrain does not know"
                if self._unknown is not None and shapely.covers(self._unknown, place)
                else f"({east:.1f}, {north:.1f}) lies {distance:.1f} m outside the geofence "
                "(limits.geofence)"
            )
        tolerance = 1e-6
        if shapely.distance(self.inner, place) > tolerance:
            edge = "the geofence's edge (limits.geofence.margin)"
            return f"({east:.1f}, {north:.1f}) lies within {self.margin:g} m of {edge}"
        return ""

    def nearest_allowed(self, position: Vector) -> Vector:
        """The point nearest to `position` that keeps the margin."""
        east, north = float(position[0]), float(position[1])
        up = min(max(float(position[2]), self.floor), self.ceiling)
        if self.inner is not None and not shapely.contains_xy(self.inner, east, north):
            way = shapely.shortest_line(self.inner, shapely.Point(east, north))
            east, north = (float(axis) for axis in shapely.get_coordinates(way)[0])
        return np.array([east, north, up])

    def nearest_within(self, position: Vector, centre: Vector, reach: float) -> Vector | None:
        """As `nearest_allowed`, within a distance of `centre`; None if there is none.

        Args:
            position: The place sought, ENU metres.
            centre: Centre of the sphere, ENU metres.
            reach: Its radius, metres.
        """
        nearest = self.nearest_allowed(position)
        rounding = 1e-9
        if length(nearest - centre) <= reach + rounding:
            return nearest
        upright = float(nearest[2] - centre[2])
        if abs(upright) >= reach:
            return None
        # The circle's corners lie upon it, so that nothing of it is farther away.
        level = shapely.Point(centre[:2]).buffer(math.sqrt(reach**2 - upright**2), quad_segs=64)
        common = level if self.inner is None else shapely.intersection(self.inner, level)
        if common.is_empty:
            return None
        way = shapely.shortest_line(common, shapely.Point(position[:2]))
        east, north = (float(axis) for axis in shapely.get_coordinates(way)[0])
        return np.array([east, north, nearest[2]])

    def inside(self, position: Vector) -> bool:
        """Return whether `position` lies inside the polygon, at any height."""
        return self.area is None or bool(shapely.contains_xy(self.area, position[0], position[1]))

    def edges_near(
        self, position: Vector, reach: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Edges of the fence near `position`.

        Args:
            position: ENU metres, of which the height does not count.
            reach: Distance within which edges are returned, metres.

        Returns:
            Unit vectors towards them (N, 2), and distances (N,) in metres.
        """
        point = np.asarray(position[:2])
        share = np.einsum("ij,ij->i", point - self._starts, self._along) / self._squared
        within = np.minimum(np.maximum(share, 0.0), 1.0)
        nearest = self._starts + within[:, None] * self._along
        way = nearest - point
        distance = np.hypot(way[:, 0], way[:, 1])
        near = distance < reach
        distance = distance[near]
        return way[near] / np.maximum(distance, 1e-9)[:, None], distance


def _polygon(outline: list[tuple[float, float]], where: str) -> shapely.Polygon:
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid or math.isclose(polygon.area, 0.0):
        reason = shapely.is_valid_reason(polygon)
        raise ConfigError(f"geofence.{where} encloses no area or crosses itself: {reason}")
    return polygon
