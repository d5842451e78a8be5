"""Reader of QGroundControl's `.plan` files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aerodaas.config.json_text import read_json
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.errors import ConfigError
from aerodaas.types.geometry import GeodeticOrigin, yaw_ned_to_enu
from aerodaas.types.waypoints import NavigationType, Waypoint, WaypointType

__all__ = ["read_plan"]

_FLIES_TO = {mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT}
_LOITERS = mavlink.MAV_CMD_NAV_LOITER_TIME
_SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
_OURS = {
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_NAV_LAND,
}
"""Items that are left out, because every mission begins and ends with them anyway."""
_RELATIVE = {
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
}


def read_plan(path: str | Path, home: GeodeticOrigin) -> AeroNavigation:
    """The waypoints of a `.plan` file, in order, local to `home` (the environment's).

    Take-off, landing and return are left out, as every mission has its own. Heights are above the
    plan's own home, whose height is assumed to be ours. Raises ConfigError for a file that
    is no plan, and for items that cannot be flown as waypoints.
    """
    place = str(path)
    content = read_json(path, "the plan")
    try:
        mission = content["mission"]
        items = list(_simple(mission["items"]))
        sea_level = float(mission["plannedHomePosition"][2])
        return AeroNavigation(
            NavigationType.DISTANCE_DRIVEN, list(_waypoints(items, home, sea_level, place))
        )
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        text = error if isinstance(error, ConfigError) else f"{type(error).__name__}: {error}"
        raise ConfigError(f"{place} is no plan of QGroundControl: {text}") from None


def _simple(items: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Simple items, and those that a survey or another complex item has been turned into."""
    for item in items:
        if item["type"] == "SimpleItem":
            yield item
        elif "TransectStyleComplexItem" in item:
            yield from _simple(item["TransectStyleComplexItem"]["Items"])
        else:
            raise ConfigError(f"a complex item of type {item.get('complexItemType')!r}")


def _waypoints(
    items: list[dict[str, Any]], home: GeodeticOrigin, sea_level: float, place: str
) -> Iterator[Waypoint]:
    speed: float | None = None
    for number, item in enumerate(items, start=1):
        command, values = item["command"], item["params"]
        if command == _SPEED and values[1] is not None and values[1] > 0:
            speed = float(values[1])
        if command not in _FLIES_TO | {_LOITERS}:
            if command in _OURS or command > mavlink.MAV_CMD_NAV_LAST:
                continue
            raise ConfigError(f"{place}, item {number}: command {command} is no waypoint")
        latitude, longitude = float(values[4]), float(values[5])
        height = float(values[6])
        if item["frame"] == mavlink.MAV_FRAME_GLOBAL:
            height -= sea_level
        elif item["frame"] not in _RELATIVE:
            raise ConfigError(f"{place}, item {number}: frame {item['frame']} is not supported")
        east, north, _ = home.to_local(latitude, longitude, home.altitude)
        yaw = values[3]
        yield Waypoint(
            f"item{number}",
            float(east),
            float(north),
            height,
            hover_duration=float(values[0] or 0.0),
            waypoint_type=WaypointType.LOCAL,
            yaw=None if yaw is None else yaw_ned_to_enu(math.radians(yaw)),
            speed=speed,
        )
