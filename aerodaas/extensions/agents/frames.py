"""Frame and units of every tool: metres east, north and up of home; headings by the compass.

A mission document counts a yaw in radians counter-clockwise from east, and a waypoint from the
place of take-off unless it says otherwise. A tool's waypoint has `heading_compass_deg` (0 north,
90 east) and is local unless it says otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import fields
from typing import Any

from aerodaas.config.checked import near
from aerodaas.errors import ConfigError
from aerodaas.extensions.agents.text import plain
from aerodaas.messages.actions import LARGEST, action_kinds
from aerodaas.messages.waypoints import Waypoint, WaypointType

__all__ = [
    "FRAMES",
    "HEADING",
    "WAYPOINT_TYPES",
    "document_waypoints",
    "heading_of_yaw",
    "tool_waypoints",
    "yaw_of_heading",
]

HEADING = "heading_compass_deg"
WAYPOINT_TYPES = tuple(one.value for one in WaypointType if one is not WaypointType.RELATIVE)
FRAMES = (
    "Places are metres east (x), north (y) and up (z) of home; the ground at home is z = 0.",
    "heading_compass_deg is where the nose points: 0 north, 90 east, 180 south, 270 west.",
    "Times are seconds, speeds m/s, charges 0 to 1, distances metres; one foot is 0.3048 m.",
    "A waypoint_type is `local` unless given; of a `global_relative` one, x is latitude.",
)
_FULL_TURN = 360.0
_FIELDS = tuple(field.name for field in fields(Waypoint))
_KNOWN = frozenset({*_FIELDS, HEADING} - {"yaw"})


def heading_of_yaw(yaw: float) -> float:
    """Compass degrees, 0 up to 360, of a yaw in radians counter-clockwise from east."""
    heading = (90.0 - math.degrees(yaw)) % _FULL_TURN
    # The remainder of a tiny negative number is rounded to the divisor.
    return 0.0 if heading == _FULL_TURN else heading


def yaw_of_heading(heading: float) -> float:
    """Yaw in radians counter-clockwise from east, above -π up to π, of compass degrees."""
    return math.radians(180.0 - (heading + 90.0) % _FULL_TURN)


def document_waypoints(waypoints: object, place: str) -> list[dict[str, Any]]:
    """Waypoints of a tool as a mission document has them.

    Args:
        waypoints: The tool's, as JSON.
        place: Where they stand, for the error.

    Raises:
        ConfigError: Names the waypoint, the field and the remedy.
    """
    if not isinstance(waypoints, list) or not all(isinstance(one, dict) for one in waypoints):
        raise ConfigError(f"{place}: waypoints are a list of objects with id, x, y and z")
    return [_document_waypoint(one, f"{place}.{number}") for number, one in enumerate(waypoints)]


def _document_waypoint(waypoint: Mapping[str, Any], place: str) -> dict[str, Any]:
    yaw = waypoint.get("yaw")
    if yaw is not None:
        radians = _number(yaw)
        meant = "" if radians is None else f": yours is {heading_of_yaw(radians):.1f}"
        raise ConfigError(f"{place}.yaw: give {HEADING}, clockwise from north{meant}")
    _require_known({name: one for name, one in waypoint.items() if name != "yaw"}, _KNOWN, place)
    for number, action in enumerate(_actions(waypoint)):
        kind: Any = action_kinds().get(str(action.get("type")))
        if kind is not None:
            known = {field.name for field in fields(kind)}
            _require_known(action, known, f"{place}.actions.{number}")
    kind = waypoint.get("waypoint_type", WaypointType.LOCAL.value)
    if kind not in WAYPOINT_TYPES:
        raise ConfigError(
            f"{place}.waypoint_type is one of {', '.join(WAYPOINT_TYPES)}: all places of these "
            "tools are counted from home"
        )
    content = {name: value for name, value in waypoint.items() if name in _FIELDS}
    content["waypoint_type"] = kind
    if waypoint.get(HEADING) is not None:
        heading = _number(waypoint[HEADING])
        if heading is None or not 0.0 <= heading <= _FULL_TURN:
            given = "" if heading is None else f", not {heading:g}"
            raise ConfigError(f"{place}.{HEADING}: a number of degrees from 0 to 360{given}")
        content["yaw"] = yaw_of_heading(heading)
    return content


def _number(value: object) -> float | None:
    """A number of a usual size; None for anything else."""
    usual = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST
    return float(value) if usual else None  # type: ignore[arg-type]


def _actions(waypoint: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    actions = waypoint.get("actions")
    return [one for one in actions if isinstance(one, dict)] if isinstance(actions, list) else []


def _require_known(content: Mapping[str, Any], known: Collection[str], place: str) -> None:
    for field in content.keys() - known:
        name = plain(field, 64)
        raise ConfigError(f"{place}.{name}: there is no such field{near(name, known)}")


def tool_waypoints(waypoints: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Waypoints of a mission document's JSON, each yaw with its compass heading beside it."""
    return [
        dict(one) if one.get("yaw") is None else {**one, HEADING: heading_of_yaw(one["yaw"])}
        for one in waypoints
    ]
