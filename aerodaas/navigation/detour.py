"""Flying around corners of the fence and no-fly zones, instead of up against them."""

from __future__ import annotations

import math

import numpy as np
import shapely
import shapely.ops
from shapely.geometry.base import BaseGeometry

from aerodaas.geometry import Vector
from aerodaas.navigation.free_path import Place, free_path
from aerodaas.navigation.geofence import Geofence

__all__ = ["Detour"]


class Detour:
    """Finds the next place on the way to a target; remembers the way while the target stays."""

    def __init__(self, fence: Geofence, clearance: float) -> None:
        """Keep inside `fence`, turning its corners `clearance` metres beyond its margin."""
        self._fence = fence
        self._clearance = clearance
        self._corners: BaseGeometry | None = None
        if fence.area is not None and fence.inner is not None:
            tighter = fence.inner.buffer(-clearance, join_style="mitre")
            self._corners = fence.inner if tighter.is_empty else tighter
        self._target: Place | None = None
        self._way: list[Place] = []

    def towards(self, target: Vector, position: Vector) -> Vector | None:
        """Where to fly next on the way from `position` to `target`, ENU metres.

        The target itself where the straight line is free, or where there is no fence. None where no
        way inside the fence leads there. Corners are flown at the target's height.
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
        # The drone may stand anywhere in the area, as after a gust, so its own margin is forgiven.
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
