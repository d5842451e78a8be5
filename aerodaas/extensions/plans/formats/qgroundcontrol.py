"""QGroundControl's `.plan` files: JSON with mission, geofence and rally points."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from typing import Any

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.commands import (
    FRAME_ABOVE_GROUND,
    FRAMES_ABOVE_GROUND,
    FRAMES_ABOVE_SEA,
    FRAMES_RELATIVE,
)
from aerodaas.extensions.plans.formats.numbers import finite, finite_or_none, place, whole
from aerodaas.extensions.plans.plan import (
    MOST_ITEMS,
    FenceCircle,
    FencePolygon,
    Notice,
    Plan,
    PlanHome,
    PlanItem,
)

__all__ = ["parse_qgroundcontrol"]

_ARDUPILOT = 3
"""MAV_AUTOPILOT of ArduPilot."""
_PARAMETERS = 7
_VERSION = 2
"""Version of the mission, the fence and the rally points that are read."""
_CORNERS = 3
_SAVE_AGAIN = "open it in a current QGroundControl and save it again"
_LANDINGS = ("fwLandingPattern", "vtolLandingPattern")
_ABOVE_TERRAIN = 3
_FRAMES_BY_MODE = {
    0: FRAMES_RELATIVE,
    1: FRAMES_RELATIVE,
    2: FRAMES_ABOVE_SEA,
    _ABOVE_TERRAIN: FRAMES_ABOVE_SEA,
    4: FRAMES_ABOVE_GROUND,
}
"""MAV_FRAMEs by AltitudeMode; 0 is that of QGroundControl 3. Mode 3 counts from the ground, and has
the sum above the sea in param 7, once QGroundControl knows the terrain."""
_SAME_HEIGHT = 0.01
"""Metres within which two numbers say one height."""


def parse_qgroundcontrol(content: object) -> Plan:
    """Read a parsed `.plan` file.

    Raises:
        ConfigError: If it is no plan, or a part has a version or form that is not known.
    """
    whole_plan = _object(content, "the file")
    kind = whole_plan.get("fileType", "Plan")
    if kind != "Plan":
        raise ConfigError(f"fileType is {str(kind)[:40]!r}, not 'Plan': {_SAVE_AGAIN}")
    if whole_plan.get("version", 1) != 1:
        raise ConfigError(f"version is {str(whole_plan['version'])[:40]}, not 1: {_SAVE_AGAIN}")
    mission = _object(whole_plan.get("mission"), "mission")
    version = mission.get("version", _VERSION)
    if version != _VERSION:
        raise ConfigError(f"mission.version is {str(version)[:40]}, not 2: {_SAVE_AGAIN}")
    items: list[PlanItem] = []
    notices: list[Notice] = []
    for entry in _entries(mission.get("items"), "mission.items"):
        items += _items(entry, len(items), notices)
        if len(items) > MOST_ITEMS:
            raise ConfigError(f"has more than {MOST_ITEMS} items: split it")
    rally = _object(whole_plan.get("rallyPoints") or {}, "rallyPoints")
    if rally.get("points"):
        notices.append(Notice((), "rally points", "a drone that returns flies to its take-off"))
    return Plan(
        tuple(items),
        home=_home(mission.get("plannedHomePosition")),
        ardupilot=mission.get("firmwareType") == _ARDUPILOT,
        fence=tuple(_fence(whole_plan.get("geoFence"), notices)),
        notices=tuple(notices),
    )


def _items(entry: object, before: int, notices: list[Notice]) -> Iterator[PlanItem]:
    """Items that one entry stands for, numbered after the `before` ones ahead of it."""
    where = f"item {before + 1}"
    item = _object(entry, where)
    if item.get("type") == "SimpleItem":
        yield _simple(item, before + 1)
        return
    kind = item.get("complexItemType")
    if "TransectStyleComplexItem" in item:
        transects = _object(item["TransectStyleComplexItem"], where)
        stored = _entries(transects.get("Items", []), f"{where}: Items")
        if not stored:
            raise ConfigError(f"{where} ({kind}) holds no items to fly: {_SAVE_AGAIN}")
        for inner in stored:
            before += 1
            yield _simple(_object(inner, f"item {before}"), before)
    elif kind in _LANDINGS:
        why = "the drone comes back to its take-off and lands there"
        notices.append(Notice((before + 1,), str(kind), why))
    else:
        raise ConfigError(
            f"{where} is of the unknown kind {str(kind or item.get('type'))[:40]!r}: "
            f"{_SAVE_AGAIN}, or draw it with waypoints"
        )


def _simple(item: dict[str, Any], number: int) -> PlanItem:
    where = f"item {number}"
    if item.get("type", "SimpleItem") != "SimpleItem":
        raise ConfigError(f"{where} is an item within an item: {_SAVE_AGAIN}")
    given = _entries(item.get("params"), f"{where}: params")
    if len(given) != _PARAMETERS:
        raise ConfigError(f"{where}: has {len(given)} params, not 7")
    numbers = count(1)
    first, second, third, fourth, x, y, z = (
        finite_or_none(value, f"{where}: param {next(numbers)}") for value in given
    )
    frame, z = _height(item, whole(item.get("frame"), f"{where}: frame"), z, where)
    return PlanItem(
        number,
        whole(item.get("command"), f"{where}: command"),
        frame,
        (first, second, third, fourth),
        x,
        y,
        z,
        _truth(item.get("autoContinue", True), f"{where}: autoContinue"),
    )


def _height(
    item: dict[str, Any], frame: int, z: float | None, where: str
) -> tuple[int, float | None]:
    """Frame and param 7 of an item, which its altitude mode must not contradict."""
    mode = item.get("AltitudeMode")
    if mode is None or all(frame not in frames for frames in _FRAMES_BY_MODE.values()):
        return frame, z
    mode = whole(mode, f"{where}: AltitudeMode")
    if frame not in _FRAMES_BY_MODE.get(mode, ()):
        raise ConfigError(
            f"{where}: AltitudeMode {mode} and frame {frame} contradict each other; set its "
            "altitude's mode in QGroundControl again and save the plan"
        )
    named = "Altitude" if mode != _ABOVE_TERRAIN else "AMSLAltAboveTerrain"
    height = finite_or_none(item.get(named), f"{where}: {named}")
    if mode == _ABOVE_TERRAIN and height is None:
        return FRAME_ABOVE_GROUND, finite(item.get("Altitude"), f"{where}: Altitude")
    if height is not None and z is not None and abs(height - z) > _SAME_HEIGHT:
        raise ConfigError(
            f"{where}: {named} is {height:g} m and param 7 is {z:g} m; enter its altitude in "
            "QGroundControl again and save the plan"
        )
    return frame, z


def _home(value: object) -> PlanHome | None:
    if value is None:
        return None
    entries = _entries(value, "plannedHomePosition")
    if len(entries) not in {2, 3}:
        raise ConfigError("plannedHomePosition must be latitude, longitude and altitude")
    latitude, longitude, altitude = [*entries, None][:3]
    return PlanHome.given(latitude, longitude, altitude)


def _fence(value: object, notices: list[Notice]) -> Iterator[FencePolygon | FenceCircle]:
    if value is None:
        return
    fence = _object(value, "geoFence")
    if fence.get("version", _VERSION) != _VERSION:
        why = f"its version is not 2 and it is not read; {_SAVE_AGAIN}"
        notices.append(Notice((), "geofence", why))
        return
    for number, entry in enumerate(_entries(fence.get("polygons", []), "geoFence.polygons"), 1):
        where = f"geofence polygon {number}"
        polygon = _object(entry, where)
        corners = _entries(polygon.get("polygon"), where)
        if len(corners) < _CORNERS:
            raise ConfigError(f"{where} has {len(corners)} corners; give it three or remove it")
        yield FencePolygon(
            _truth(polygon.get("inclusion"), f"{where}: inclusion"),
            tuple(place(*_pair(corner, where), where) for corner in corners),
        )
    for number, entry in enumerate(_entries(fence.get("circles", []), "geoFence.circles"), 1):
        where = f"geofence circle {number}"
        outer = _object(entry, where)
        circle = _object(outer.get("circle"), where)
        radius = finite(circle.get("radius"), f"{where}: radius")
        if radius <= 0.0:
            raise ConfigError(f"{where}: radius must be positive, not {radius:g}; or remove it")
        yield FenceCircle(
            _truth(outer.get("inclusion"), f"{where}: inclusion"),
            place(*_pair(circle.get("center"), where), where),
            radius,
        )


def _object(value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ConfigError(f"{where} must be an object")
    return value


def _entries(value: object, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise ConfigError(f"{where} must be a list")
    if len(value) > MOST_ITEMS:
        raise ConfigError(f"{where} has more than {MOST_ITEMS} entries: split the plan")
    return value


def _pair(value: object, where: str) -> tuple[object, object]:
    entries = _entries(value, where)
    if len(entries) != 2:  # noqa: PLR2004 - latitude, longitude
        raise ConfigError(f"{where} must be made of latitude and longitude")
    return entries[0], entries[1]


def _truth(value: object, what: str) -> bool:
    if not isinstance(value, bool):
        raise ConfigError(f"{what} must be true or false")
    return value
