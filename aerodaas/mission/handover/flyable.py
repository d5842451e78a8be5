"""What of a mission an autopilot can fly by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from aerodaas.config.robot import LimitsConfig
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission_mode import PlannedPlace
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.queue import QueuedWaypoint
from aerodaas.mission.route import Route
from aerodaas.mission.safety.ground_clearance import GroundClearance

__all__ = ["planned_places", "unflyable"]

_NAMED = 3
"""Most reasons that are named."""


def planned_places(
    stops: Sequence[QueuedWaypoint], limits: LimitsConfig, fastest: float
) -> list[PlannedPlace]:
    """The places of `stops`; `fastest` is what the vehicle can do, m/s."""
    most = min(limits.max_speed, fastest)
    return [
        PlannedPlace(
            stop.waypoint.position,
            min(stop.waypoint.speed or limits.cruise_speed, most),
            max(0.0, stop.remaining_hover),
            stop.waypoint.yaw,
        )
        for stop in stops
    ]


def unflyable(
    stops: Sequence[QueuedWaypoint],
    position: Vector,
    limits: LimitsConfig,
    route: Route,
    clearance: GroundClearance | None,
) -> str:
    """Why an autopilot cannot fly from `position` (ENU metres) by `stops`; empty if it can."""
    reasons = []
    if limits.rangefinder_clearance > 0.0:
        reasons.append("rangefinder_clearance is kept by setpoints alone")
    reasons += [f"{stop.id}: {text}" for stop in stops for text in _asks(stop.waypoint)]
    places = [position, *(stop.waypoint.position for stop in stops)]
    for stop, (start, end) in zip(stops, pairwise(places), strict=True):
        text = ""
        if stop.above_ground is not None:
            text = "the way there follows the ground"
        elif route.towards(end, start) is not end:
            text = "the way there leads around a no-fly zone or a corner of the geofence"
        elif clearance is not None:
            text = _too_low(start, end, clearance)
        reasons += [f"{stop.id}: {text}"] if text else []
    more = f"; and {len(reasons) - _NAMED} more" if len(reasons) > _NAMED else ""
    return "; ".join(reasons[:_NAMED]) + more


def _asks(waypoint: Waypoint) -> Iterator[str]:
    if waypoint.photo or waypoint.trigger_distance or waypoint.trigger_interval:
        yield "it takes pictures"
    if waypoint.gimbal is not None or waypoint.look_at is not None:
        yield "it turns the gimbal"
    if waypoint.lens is not None:
        yield "it sets the camera's lens"
    if waypoint.video is not None:
        yield "it begins or ends a video"
    if waypoint.actuate:
        yield "it moves actuators"


def _too_low(start: Vector, end: Vector, clearance: GroundClearance) -> str:
    distances, heights = clearance.ground.along(start, end)
    long = float(distances[-1])
    shares = distances / long if long > 0.0 else np.zeros_like(distances)
    above = start[2] + shares * (end[2] - start[2]) - heights
    # NaN, where the ground is not known, is too low.
    if bool(np.all(above >= clearance.clearance)):
        return ""
    return f"the way there comes nearer to the ground than {clearance.clearance:g} m"
