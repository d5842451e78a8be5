"""Plan files of ground stations, told apart by what is in them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.errors import ConfigError, InvalidWaypointError
from aerodaas.extensions.plans.formats.qgroundcontrol import parse_qgroundcontrol
from aerodaas.extensions.plans.formats.waypoint_file import HEADER, parse_waypoint_file
from aerodaas.extensions.plans.plan import Notice, Plan
from aerodaas.extensions.plans.waypoints_in import Ground, waypoints_of
from aerodaas.messages.waypoints import Waypoint
from aerodaas.text.json_text import parse_json, read_text
from aerodaas.text.printable import printable

__all__ = ["flown_plan", "read_plan"]


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
