"""The next point of the way to a place: around the corners of the fence, and over the ground."""

from __future__ import annotations

import math

import numpy as np
import shapely
import shapely.ops
from shapely.geometry.base import BaseGeometry

from aerodaas.config.model import LimitsConfig
from aerodaas.geometry.frames import Vector
from aerodaas.geometry.free_path import Place, free_path
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance

__all__ = ["Detour", "Route"]


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

        Corners are flown at the target's height.

        Args:
            target: Where the route ends, ENU metres.
            position: Where the drone is, ENU metres.

        Returns:
            The target itself if the straight line is free, or if there is no fence; None if no
            route inside the fence leads there.
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


class Route:
    """Finds the ways of one drone."""

    def __init__(
        self,
        fence: Geofence,
        limits: LimitsConfig,
        home: Vector,
        clearance: GroundClearance | None = None,
    ) -> None:
        """Stay inside `fence`, and above the ground where it is known; return to `home`."""
        self._detour = Detour(fence, limits.arrival_radius)
        self._clearance = clearance
        speed = limits.max_speed
        # Twice the braking distance, so that the point ahead never slows the drone down.
        self._ahead = speed * (2 * limits.reaction_time + speed / limits.max_acceleration)
        self._home = home
        self._lowest = float(home[2]) + limits.takeoff_height
        self._return_height: float | None = None

    def towards(
        self, target: Vector, position: Vector, above_ground: float | None = None
    ) -> Vector | None:
        """The next point to fly to from `position`, ENU metres; None if no way leads to `target`.

        Args:
            target: Where the way ends, ENU metres.
            position: Where the drone is, ENU metres.
            above_ground: Metres to keep above the ground: the point lies ahead, at the end of the
                lowest straight line that keeps them all along; None does not follow the ground.
        """
        place = self._detour.towards(target, position)
        if place is None or above_ground is None or self._clearance is None:
            return place
        way = place[:2] - position[:2]
        long = math.hypot(*way)
        rounding = 1e-3
        if long < rounding:
            return place
        ground = self._clearance.ground
        end = position[:2] + way * (min(long, self._ahead + ground.spacing / 2) / long)
        distances, heights = ground.along(position, end)
        slopes = (heights[1:] - heights[0]) / distances[1:]
        # NaN would compare as anything; the fence has no way over unknown ground.
        rise = float(np.nanmax(slopes, initial=-math.inf)) * float(distances[-1])
        height = float(heights[0]) + rise + above_ground
        return np.array([*end, height]) if math.isfinite(height) else place

    def above_home(self, position: Vector) -> Vector:
        """The place above home to return to, from where it is first asked for.

        It is no lower than `position`, and lies above all ground on the straight way.
        """
        if self._return_height is None:
            self._return_height = max(float(position[2]), self._lowest)
            if self._clearance is not None:
                _, heights = self._clearance.ground.along(position, self._home)
                highest = float(np.nanmax(heights, initial=-math.inf))
                self._return_height = max(self._return_height, highest + self._clearance.clearance)
        return np.array([self._home[0], self._home[1], self._return_height])
