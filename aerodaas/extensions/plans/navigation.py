"""Waypoints of an application from a plan, and as one."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.errors import ConfigError, InvalidWaypointError
from aerodaas.extensions.plans.formats.qgroundcontrol import parse_qgroundcontrol
from aerodaas.extensions.plans.formats.waypoint_file import HEADER, parse_waypoint_file
from aerodaas.extensions.plans.plan import Notice, Plan
from aerodaas.extensions.plans.waypoints_in import Ground, waypoints_of
from aerodaas.extensions.plans.writing import planned, write_plan
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.waypoints import Waypoint
from aerodaas.text.json_text import parse_json, read_text
from aerodaas.text.printable import printable

__all__ = ["flown_plan", "read_plan", "read_waypoints", "write_waypoints"]


def read_plan(path: str | Path) -> Plan:
    """Read QGroundControl's `.plan` or Mission Planner's `.waypoints`.

    Raises:
        ConfigError: If it cannot be read, or is no plan; with file, place and remedy.
    """
    text = read_text(path, "the plan").lstrip("\ufeff \t\r\n")
    try:
        return _parsed(text)
    except ConfigError as error:
        raise ConfigError(f"{path} cannot be read as a plan: {printable(str(error))}") from None


def _parsed(text: str) -> Plan:
    if text.startswith(HEADER[:7]):
        return parse_waypoint_file(text)
    if text.startswith("<"):
        raise ConfigError("it is XML; of KML, `read_areas` reads the areas")
    content = parse_json(text, "it")
    if isinstance(content, dict) and "mission" not in content and "type" in content:
        raise ConfigError("it is GeoJSON, of which `read_areas` reads the areas")
    return parse_qgroundcontrol(content)


def flown_plan(
    path: str | Path,
    home_altitude: float | None = None,
    ground: Ground | None = None,
    actuators: Sequence[ActuatorConfig] = (),
) -> tuple[list[Waypoint], list[Notice]]:
    """Read a plan's waypoints.

    Args:
        path: QGroundControl's `.plan`, or Mission Planner's `.waypoints`.
        home_altitude: Metres above the sea of the environment's home; None for the plan's own.
        ground: Height in metres of the ground above the sea at a latitude and longitude in degrees.
        actuators: Those of the robot.

    Returns:
        The waypoints in order, and what they leave out.

    Raises:
        ConfigError: If the file is no plan, or an item cannot be flown.
    """
    plan = read_plan(path)
    try:
        return waypoints_of(plan, home_altitude, ground, actuators)
    except (ConfigError, InvalidWaypointError) as error:
        raise ConfigError(f"{path} cannot be flown: {error}") from None


_MOST_NOTICES = 20


def read_waypoints(
    path: str | Path,
    home_altitude: float | None,
    ground: Ground | None,
    actuators: Sequence[ActuatorConfig],
    *,
    stacklevel: int,
) -> list[Waypoint]:
    """Read a plan's waypoints in order; what they leave out is told by one warning.

    Args:
        path: QGroundControl's `.plan`, or Mission Planner's `.waypoints`.
        home_altitude: Metres above the sea of the environment's home; None for the plan's own.
        ground: Height in metres of the ground above the sea at a latitude and longitude in degrees.
        actuators: Those of the robot.
        stacklevel: Frames from the caller to the line that is warned of, as of `warnings.warn`.

    Raises:
        ConfigError: If the file is no plan, or an item cannot be flown.
    """
    waypoints, notices = flown_plan(path, home_altitude, ground, actuators)
    _warn_of(path, notices, stacklevel + 1)
    return waypoints


def write_waypoints(
    path: str | Path,
    waypoints: Sequence[Waypoint],
    home: GeodeticOrigin,
    home_altitude: float | None,
    actuators: Sequence[ActuatorConfig],
    *,
    stacklevel: int,
) -> None:
    """Write waypoints as a new plan; what the file leaves out is told by one warning.

    Args:
        path: The file, with the format as its suffix.
        waypoints: Waypoints in order, local or global.
        home: Origin of the local frame.
        home_altitude: Metres above the sea of home; None if unknown.
        actuators: Those of the robot.
        stacklevel: Frames from the caller to the line that is warned of, as of `warnings.warn`.

    Raises:
        ConfigError: If a waypoint cannot be written, the suffix is another, or the file exists or
            cannot be written.
    """
    plan, notices = planned(waypoints, home, home_altitude, actuators)
    _warn_of(path, [*notices, *write_plan(path, plan)], stacklevel + 1)


def _warn_of(path: str | Path, notices: list[Notice], stacklevel: int) -> None:
    if not notices:
        return
    lines = [f"  {printable(str(notice))}" for notice in notices[:_MOST_NOTICES]]
    more = len(notices) - _MOST_NOTICES
    lines += [f"  and {more} more: `aerodaas plan show` lists them"] if more > 0 else []
    told = "\n".join([f"{path}: not everything in this plan is done:", *lines])
    warnings.warn(told, stacklevel=stacklevel + 1)
