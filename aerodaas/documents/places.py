"""Check of single places against the fence, heights, range and speed of one robot."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import shapely

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry.frames import Vector, length
from aerodaas.messages.waypoints import HeightDatum, Waypoint
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.protocol.proposals import CheckName, Finding

__all__ = ["ROUNDING", "PlaceCheck", "as_triple", "shown_place"]

ROUNDING = 1e-6
"""Metres and charge by which a limit may be exceeded, by rounding alone."""


class PlaceCheck:
    """Check of single places against the fence, heights, range and speed of one robot."""

    def __init__(
        self,
        robot: RobotConfig,
        config: EnvironmentConfig,
        start: Vector,
        fence: Geofence,
        ground: GroundClearance | None,
    ) -> None:
        """Check places of one robot.

        Args:
            robot: The robot, with its limits.
            config: Environment, for its home.
            start: Where the robot takes off, ENU metres.
            fence: Its fence.
            ground: The ground; None without a terrain.
        """
        self._robot = robot
        self._start = start
        self._fence = fence
        self._ground = ground
        home = config.home
        self._origin = home.origin if home else None
        self._datum = HeightDatum(
            home.above_sea if home else None, ground.ground.height if ground else None
        )
        limits = robot.limits.geofence
        self._polygon = shapely.Polygon(limits.polygon) if limits.polygon else None
        self._no_fly = [shapely.Polygon(outline) for outline in limits.no_fly]

    def resolve(
        self, navigation: AeroNavigation, deadline: float | None
    ) -> tuple[dict[str, Waypoint], list[Finding]]:
        """Flyable waypoints in the local frame by id, and the findings about the others.

        Args:
            navigation: The waypoints.
            deadline: Seconds of mission time by which all are to be reached; None for their own.
        """
        local: dict[str, Waypoint] = {}
        found: list[Finding] = []
        for asked in navigation.waypoints:
            try:
                waypoint = asked.resolve(self._start, self._origin, self._datum)
            except InvalidWaypointError as error:
                remedy = "give the waypoint in another frame"
                found.append(self._finding("document", asked.id, None, str(error), remedy))
                continue
            reasons = [*self._reasons(waypoint)]
            found += reasons
            if not reasons:
                limits = [one for one in (waypoint.deadline, deadline) if one is not None]
                local[asked.id] = replace(waypoint, deadline=min(limits, default=None))
        return local, found

    def _finding(
        self,
        check: CheckName,
        waypoint: str,
        place: Vector | None,
        text: str,
        remedy: str,
        **figures: Any,  # noqa: ANN401 - fields of a finding
    ) -> Finding:
        return Finding(
            check=check,
            text=f"{self._robot.id}: {text}",
            remedy=remedy,
            robot=self._robot.id,
            waypoint=waypoint,
            place=None if place is None else as_triple(place),
            **figures,
        )

    def _reasons(self, waypoint: Waypoint) -> Iterator[Finding]:
        limits, place, name = self._robot.limits, waypoint.position, waypoint.id
        where = f"waypoint {name!r} at {shown_place(place)}"
        yield from self._level_reasons(name, where, place)
        yield from self._height_reasons(name, where, place)
        away = length(place - self._start)
        if away > limits.max_range:
            yield self._finding(
                "range",
                name,
                place,
                f"{where} is {away:.0f} m from the take-off, and the range is "
                f"{limits.max_range:g} m",
                "move it nearer to the take-off",
                measured=away,
                limit=limits.max_range,
                unit="m",
            )
        if waypoint.speed is not None and waypoint.speed > limits.max_speed:
            yield self._finding(
                "speed",
                name,
                place,
                f"{where} asks for {waypoint.speed:g} m/s, and the drone flies at most "
                f"{limits.max_speed:g} m/s",
                f"ask for {limits.max_speed:g} m/s or less",
                measured=waypoint.speed,
                limit=limits.max_speed,
                unit="m/s",
            )

    def _level_reasons(self, name: str, where: str, place: Vector) -> Iterator[Finding]:
        fence = self._robot.limits.geofence
        point = shapely.Point(place[:2])
        nearest = self._fence.nearest_allowed(place)
        remedy = f"move it to {shown_place(nearest)}, the nearest place allowed"
        for zone in self._no_fly:
            inside = shapely.covers(zone, point)
            edge = float(shapely.distance(zone.exterior, point))
            kept = -edge if inside else edge
            if kept < fence.margin - ROUNDING:
                what = f"{edge:.1f} m inside" if inside else f"{edge:.1f} m from"
                yield self._finding(
                    "no_fly",
                    name,
                    place,
                    f"{where} lies {what} a no-fly zone, of which {fence.margin:g} m are kept",
                    remedy,
                    measured=kept,
                    limit=fence.margin,
                    unit="m",
                )
        if self._polygon is None:
            return
        inside = shapely.covers(self._polygon, point)
        edge = float(shapely.distance(self._polygon.exterior, point))
        kept = edge if inside else -edge
        if kept < fence.margin - ROUNDING:
            what = (
                f"lies {edge:.1f} m inside the fence, of whose edge {fence.margin:g} m are kept"
                if inside
                else f"lies {edge:.1f} m outside the fence"
            )
            yield self._finding(
                "fence",
                name,
                place,
                f"{where} {what}",
                remedy,
                measured=kept,
                limit=fence.margin,
                unit="m",
            )

    def _height_reasons(self, name: str, where: str, place: Vector) -> Iterator[Finding]:
        fence, up = self._robot.limits.geofence, float(place[2])
        if up > fence.ceiling:
            yield self._finding(
                "ceiling",
                name,
                place,
                f"{where} is {up - fence.ceiling:.1f} m above the ceiling of {fence.ceiling:g} m",
                f"fly at {fence.ceiling:g} m or lower",
                measured=up,
                limit=fence.ceiling,
                unit="m",
            )
        if up < fence.floor:
            yield self._finding(
                "floor",
                name,
                place,
                f"{where} is {fence.floor - up:.1f} m below the floor of {fence.floor:g} m",
                f"fly at {fence.floor:g} m or higher",
                measured=up,
                limit=fence.floor,
                unit="m",
            )
        if self._ground is None or not (objection := self._ground.objection(place)):
            return
        needed = self._ground.needed(float(place[0]), float(place[1]))
        known = not math.isnan(needed)
        yield self._finding(
            "ground",
            name,
            place,
            f"{where}: {objection}",
            f"fly at {needed:.1f} m or higher" if known else "move it to where the ground is known",
            measured=up if known else None,
            limit=needed if known else None,
            unit="m",
        )


def as_triple(place: Iterable[float]) -> tuple[float, float, float]:
    """A place to the centimetre, for a finding."""
    east, north, up = (round(float(axis), 2) for axis in place)
    return east, north, up


def shown_place(place: Vector) -> str:
    """A place as text, metres east, north and up."""
    return "({:.1f}, {:.1f}, {:.1f})".format(*place)
