"""Routes around corners of the geofence and no-fly zones."""

from __future__ import annotations

import math

import numpy as np
import shapely
import shapely.ops
from shapely.geometry.base import BaseGeometry

from aerodaas.geometry.frames import Vector
from aerodaas.geometry.free_path import Place, free_path
from aerodaas.mission.safety.geofence import Geofence

__all__ = ["Detour"]


class Detour:
    """Finds the next point of a route to a target; caches the route while the target stays."""

    def __init__(self, fence: Geofence, clearance: float) -> None:
        """Stay inside `fence`, passing its corners `clearance` metres beyond its margin."""
        self._fence = fence
        self._clearance = clearance
        self._corners: BaseGeometry | None = None
        if fence.area is not None and fence.inner is not None:
            tighter = fence.inner.buffer(-clearance, join_style="mitre")
            self._corners = fence.inner if tighter.is_empty else tighter
        self._target: Place | None = None
        self._way: list[Place] = []

    def towards(self, target: Vector, position: Vector) -> Vector | None:
        """The next point to fly to on the route from `position` to `target`, ENU metres.

        The target itself if the straight line is free, or if there is no fence. None if no route
        inside the fence leads there. Corners are flown at the target's height.
        """
        if self._corners is None:
            return target
        here, there = _place(position), _place(target)
        if self._is_free(here, there):
            self._target = None
            return target
        if there != self._target or not self._way or not self._is_free(here, self._way[0]):
            way = self._find(here, there)
            if way is None:
                return None
            self._target, self._way = there, way
        while len(self._way) > 1 and (
            self._is_free(here, self._way[1]) or math.dist(here, self._way[0]) < self._clearance
        ):
            del self._way[0]
        return np.array([*self._way[0], target[2]])

    def _is_free(self, here: Place, there: Place) -> bool:
        # The drone may be anywhere in the area, as after a gust, so the margin is waived at its
        # position.
        line = shapely.LineString([here, there])
        reach = self._fence.margin
        return bool(shapely.covers(self._fence.inner, line)) or (
            math.dist(here, there) > reach
            and bool(shapely.covers(self._fence.area, line))
            and bool(shapely.covers(self._fence.inner, shapely.ops.substring(line, reach, 1e9)))
        )

    def _find(self, here: Place, there: Place) -> list[Place] | None:
        if self._corners is None:
            return [there]
        inside = _place(self._fence.nearest_allowed(np.array([*here, 0.0])))
        rounded = free_path(self._corners, self._nearest(inside), self._nearest(there))
        return None if rounded is None else [*rounded[1:], there]

    def _nearest(self, place: Place) -> Place:
        line = shapely.shortest_line(self._corners, shapely.Point(place))
        x, y = shapely.get_coordinates(line)[0]
        return float(x), float(y)


def _place(position: Vector) -> Place:
    return float(position[0]), float(position[1])
