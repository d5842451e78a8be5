"""Waypoints as a plan's items, and plans as files of ground stations."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import ConfigError
from aerodaas.extensions.actuators.actions import MoveActuator
from aerodaas.extensions.payload.actions import LookAt, RecordVideo, SetLens
from aerodaas.extensions.plans.actuators import move_item
from aerodaas.extensions.plans.commands import (
    FRAME_ABOVE_GROUND,
    FRAME_ABOVE_SEA,
    FRAME_MISSION,
    FRAME_RELATIVE,
)
from aerodaas.extensions.plans.formats.waypoint_file import HEADER
from aerodaas.extensions.plans.pictures_out import PictureWriter
from aerodaas.extensions.plans.plan import Notice, Plan, PlanHome, PlanItem
from aerodaas.geometry.frames import GeodeticOrigin, yaw_enu_to_ned
from aerodaas.messages.waypoints import DEFAULT_PRIORITY, HeightReference, Waypoint, WaypointType

__all__ = ["planned", "write_plan"]

_LOWEST_TAKEOFF = 1.5
"""Metres that a take-off climbs at least."""
_DEFAULT_SPEED = -2.0
_GROUND_SPEED = 1.0
_PX4 = 12
"""MAV_AUTOPILOT, by which the meaning of parameters is known."""
_COPTER = 2
"""MAV_TYPE."""
_FRAMES = {
    HeightReference.SEA: FRAME_ABOVE_SEA,
    HeightReference.GROUND: FRAME_ABOVE_GROUND,
}
_ALTITUDE_MODES = {FRAME_RELATIVE: 1, FRAME_ABOVE_SEA: 2, FRAME_ABOVE_GROUND: 4}
"""QGroundControl's, by frame."""


def planned(
    waypoints: Sequence[Waypoint],
    home: GeodeticOrigin,
    home_altitude: float | None = None,
    actuators: Sequence[ActuatorConfig] = (),
) -> tuple[Plan, list[Notice]]:
    """Turn waypoints into a plan that starts at `home`.

    Args:
        waypoints: Waypoints in order, local or global.
        home: Origin of the local frame.
        home_altitude: Metres above the sea of home; None if unknown.
        actuators: Those of the robot, by whose instances and channels `actuate` is written.

    Returns:
        The plan, and what it leaves out.

    Raises:
        ConfigError: If a waypoint is relative to a take-off, whose place is not known yet, or
            moves what is none of `actuators`.
    """
    places = [_place(waypoint, home) for waypoint in waypoints]
    items = [
        replace(item, number=number)
        for number, item in enumerate(_items(waypoints, places, home, actuators), start=1)
    ]
    return (
        Plan(tuple(items), home=PlanHome(home.latitude, home.longitude, home_altitude)),
        list(_left_out(waypoints)),
    )


def write_plan(path: str | Path, plan: Plan) -> list[Notice]:
    """Write a new `.plan` or `.waypoints` file, by its suffix.

    Args:
        path: The file.
        plan: The plan.

    Returns:
        What the file leaves out.

    Raises:
        ConfigError: If the suffix is another, or the file exists or cannot be written.
    """
    file = Path(path)
    if file.suffix == ".plan":
        text, notices = _qgroundcontrol(plan), []
    elif file.suffix == ".waypoints":
        text, notices = _waypoint_file(plan), list(_not_in_lines(plan))
    else:
        raise ConfigError(f"a plan is written as .plan or .waypoints, not as {file.name!r}")
    try:
        with file.open("x", encoding="utf-8") as opened:
            opened.write(text)
    except FileExistsError:
        raise ConfigError(f"{path} exists; remove it or choose another name") from None
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}") from None
    return notices


def _place(waypoint: Waypoint, home: GeodeticOrigin) -> tuple[float, float, float]:
    """Latitude, longitude, and metres above home, or what else the waypoint names."""
    if waypoint.waypoint_type is WaypointType.RELATIVE:
        raise ConfigError(
            f"waypoint {waypoint.id!r} is relative to a take-off that no plan knows; "
            'give it waypoint_type "local", "global" or "global_relative"'
        )
    if waypoint.waypoint_type is WaypointType.LOCAL:
        latitude, longitude, _ = home.to_geodetic(np.array([waypoint.x, waypoint.y, 0.0]))
        return latitude, longitude, waypoint.z
    ellipsoid = waypoint.waypoint_type is WaypointType.GLOBAL and waypoint.above is None
    return waypoint.x, waypoint.y, waypoint.z - (home.altitude if ellipsoid else 0.0)


def _spot(waypoint: Waypoint, home: GeodeticOrigin) -> tuple[float, float, float] | None:
    """The place that a waypoint looks at, as `_place` writes one."""
    look = waypoint.action(LookAt)
    if look is None:
        return None
    return _place(replace(waypoint, x=look.x, y=look.y, z=look.z, actions=()), home)


def _items(
    waypoints: Sequence[Waypoint],
    places: Sequence[tuple[float, float, float]],
    home: GeodeticOrigin,
    actuators: Sequence[ActuatorConfig],
) -> Iterator[PlanItem]:
    # How high a place above the sea lies above home, the plan need not know.
    above_home = places and waypoints[0].above is not HeightReference.SEA
    climb = max(places[0][2], _LOWEST_TAKEOFF) if above_home else _LOWEST_TAKEOFF
    start = (home.latitude, home.longitude, climb)
    yield PlanItem(0, mavlink.MAV_CMD_NAV_TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), *start)
    pictures, speed = PictureWriter(), None
    for waypoint, at in zip(waypoints, places, strict=True):
        if waypoint.speed != speed:
            speed = waypoint.speed
            values = (_GROUND_SPEED, _DEFAULT_SPEED if speed is None else speed, -1.0, 0.0)
            yield PlanItem(0, mavlink.MAV_CMD_DO_CHANGE_SPEED, FRAME_MISSION, values, 0.0, 0.0, 0.0)
        yaw = None if waypoint.yaw is None else math.degrees(yaw_enu_to_ned(waypoint.yaw))
        # An autopilot does what stands behind a waypoint after its stay; a video comes before it.
        stay = 0.0 if waypoint.action(RecordVideo) else waypoint.hover_duration
        held = (stay, 0.0, 0.0, yaw)
        above = HeightReference(waypoint.above or HeightReference.HOME)
        frame = _FRAMES.get(above, FRAME_RELATIVE)
        yield from pictures.before(waypoint, frame, _spot(waypoint, home))
        yield PlanItem(0, mavlink.MAV_CMD_NAV_WAYPOINT, frame, held, *at)
        yield from pictures.behind(waypoint)
        for action in waypoint.actions:
            if isinstance(action, MoveActuator):
                yield move_item(0, action.actuator, action.position, actuators)
    yield from pictures.end()
    still = (0.0, 0.0, 0.0, 0.0)
    yield PlanItem(0, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, FRAME_MISSION, still, 0.0, 0.0, 0.0)


def _left_out(waypoints: Sequence[Waypoint]) -> Iterator[Notice]:
    for what, named in (
        ("priorities", [w.id for w in waypoints if w.priority != DEFAULT_PRIORITY]),
        ("deadlines", [w.id for w in waypoints if w.deadline is not None]),
        ("zoom and focus", [w.id for w in waypoints if w.action(SetLens)]),
    ):
        if named:
            yield Notice(
                (), what, f"a plan holds none; {len(named)} waypoints had one: {named[0]}…"
            )


def _not_in_lines(plan: Plan) -> Iterator[Notice]:
    turned = tuple(
        one.number
        for one in plan.items
        if one.command == mavlink.MAV_CMD_NAV_WAYPOINT and one.values[3] is not None
    )
    if turned:
        yield Notice(turned, "NAV_WAYPOINT", "ArduPilot does not turn to a waypoint's yaw")


def _waypoint_file(plan: Plan) -> str:
    home = PlanItem(0, mavlink.MAV_CMD_NAV_WAYPOINT, 0, (0.0, 0.0, 0.0, None), *_home(plan.home))
    lines = [HEADER, _line(home)]
    lines += map(_line, plan.items)
    return "\n".join([*lines, ""])


def _home(home: PlanHome | None) -> tuple[float, float, float]:
    """Latitude, longitude and altitude; zeros, which mean to readers that they are not known."""
    return (home.latitude, home.longitude, home.altitude or 0.0) if home else (0.0, 0.0, 0.0)


def _line(item: PlanItem) -> str:
    values = [*item.values, item.x, item.y]
    numbers = [f"{value or 0.0:.8f}" for value in values] + [f"{item.z or 0.0:.6f}"]
    head = [item.number, int(item.number == 0), item.frame, item.command]
    return "\t".join([*map(str, head), *numbers, str(int(item.continues))])


def _qgroundcontrol(plan: Plan) -> str:
    content = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "AeroDaaS",
        "mission": {
            "version": 2,
            "firmwareType": _PX4,
            "vehicleType": _COPTER,
            "cruiseSpeed": 15,
            "hoverSpeed": 5,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": _home(plan.home),
            "items": [_entry(item) for item in plan.items],
        },
        "geoFence": {"version": 2, "polygons": [], "circles": []},
        "rallyPoints": {"version": 2, "points": []},
    }
    return json.dumps(content, indent=4) + "\n"


def _entry(item: PlanItem) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "type": "SimpleItem",
        "autoContinue": item.continues,
        "command": item.command,
        "doJumpId": item.number,
        "frame": item.frame,
        "params": [*item.values, item.x, item.y, item.z],
    }
    mode = _ALTITUDE_MODES.get(item.frame)
    if mode is not None:
        entry |= {"AMSLAltAboveTerrain": None, "Altitude": item.z, "AltitudeMode": mode}
    return entry
