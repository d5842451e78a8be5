"""The next point of the way to a place: around the corners of the fence, and over the ground."""

from __future__ import annotations

import math

import numpy as np

from aerodaas.config.model import LimitsConfig
from aerodaas.geometry.frames import Vector
from aerodaas.mission.safety.detour import Detour
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance

__all__ = ["Route"]


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

        With `above_ground` metres, the way follows the ground: the point lies ahead, at the end of
        the lowest straight line that keeps this height all along.
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
