"""Waypoints that are flown through: at what speed, by the turn that follows.

A drone stops where it has something to do, where it is to look elsewhere first, at the end of its
plan, and where what follows is not certain. At all other waypoints it turns while it flies: what it
flies across the next leg it has to brake within the arrival radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from aerodaas.config.sections.robot import LimitsConfig
from aerodaas.geometry.braking import braking_distance, braking_speed
from aerodaas.geometry.frames import Vector, length
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.action_executor import ActionRunner, Course
from aerodaas.mission.navigation.leg import Leg
from aerodaas.mission.navigation.navigator import Navigator
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.navigation.route import Route

__all__ = ["Cornering", "corner_speed"]

_LOOK = 0.1
"""Seconds in which a drone flies at most the arrival radius, so that two of its positions lie
within it: the odometry of a slow link comes ten times a second."""
_ROUNDING = 1e-6
"""Metres, and the sine of an angle, that count as none."""


def corner_speed(arriving: Vector, leaving: Vector, limits: LimitsConfig) -> float:
    """Speed at which a drone may turn at a waypoint from `arriving` to `leaving`, m/s.

    The part across the next leg, or all of it at a right angle and more, stops within the arrival
    radius; it is never faster than its position is looked at.

    Args:
        arriving: Unit vector of the leg that ends at the waypoint, ENU.
        leaving: Unit vector of the leg that begins there, ENU.
        limits: Arrival radius, acceleration and reaction time of the drone.
    """
    radius = limits.arrival_radius
    onwards = float(arriving @ leaving)
    across = 1.0 if onwards <= 0.0 else math.sqrt(max(0.0, 1.0 - onwards * onwards))
    stops = braking_speed(radius, limits.max_acceleration, limits.reaction_time)
    straight = across <= _ROUNDING
    return min(radius / _LOOK, math.inf if straight else stops / across)


def passing_speed(turning: float, limits: LimitsConfig) -> float:
    """Speed at a waypoint so that a drone that brakes towards it turns at `turning`, m/s.

    Args:
        turning: Speed at which it turns where it arrives, that is at the arrival radius, m/s.
        limits: Arrival radius, acceleration and reaction time of the drone.
    """
    a, t = limits.max_acceleration, limits.reaction_time
    return braking_speed(braking_distance(turning, a, t) - limits.arrival_radius, a, t)


@dataclass(slots=True)
class Cornering:
    """Speeds at which the drone of one mission passes its waypoints."""

    navigator: Navigator
    actions: ActionRunner
    route: Route
    limits: LimitsConfig
    _stops: tuple[QueuedWaypoint, QueuedWaypoint] | None = field(default=None, init=False)
    _leaving: Vector | None = field(default=None, init=False)

    def passing_speed(self, leg: Leg, course: Course, odometry: Odometry) -> float:
        """Speed at which the drone passes the place of `course`, m/s; 0 where it stops there.

        Args:
            leg: The leg under way.
            course: Course on it.
            odometry: Where the drone is and how it moves.
        """
        stop, following = leg.stop, self.navigator.following
        way = stop.waypoint.position - odometry.position
        distance = length(way)
        rest = length(stop.waypoint.position - course.place)
        if not course.brakes and rest > _ROUNDING:
            limits = self.limits
            stops = braking_speed(rest, limits.max_acceleration, limits.reaction_time)
            return min(stop.waypoint.speed or limits.cruise_speed, stops)
        if (
            following is None
            or distance <= _ROUNDING
            or rest > _ROUNDING
            or not leg.is_facing(odometry.yaw)
            or _stays(stop.waypoint)
            or self.actions.stops_at(stop, following, self.limits.arrival_radius)
        ):
            return 0.0
        leaving = self._way_on(stop, following)
        if leaving is None:
            return 0.0
        turning = corner_speed(way / distance, leaving, self.limits)
        cruise = self.limits.cruise_speed
        legs = [one.waypoint.speed or cruise for one in (stop, following)]
        return min(*legs, passing_speed(turning, self.limits))

    def _way_on(self, stop: QueuedWaypoint, following: QueuedWaypoint) -> Vector | None:
        """Direction in which the drone leaves `stop`, a unit vector; None if no way leads on."""
        if self._stops is None or self._stops != (stop, following):
            here, there = stop.waypoint.position, following.waypoint.position
            place = self.route.towards(there, here, following.above_ground)
            way = np.zeros(3) if place is None else place - here
            far = length(way)
            self._stops = (stop, following)
            self._leaving = way / far if far > _ROUNDING else None
        return self._leaving


def _stays(waypoint: Waypoint) -> bool:
    """Whether there is something to do at a waypoint for which the drone stays there."""
    return waypoint.hover_duration > 0.0 or any(action.stops for action in waypoint.actions)
