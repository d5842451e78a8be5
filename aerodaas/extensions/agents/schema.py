"""JSON schema of what agents write: the mission document in the tools' frame, with bounds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.documents import schema as documents
from aerodaas.extensions.agents.frames import HEADING, WAYPOINT_TYPES

__all__ = ["AsJson", "bounded", "document_schema", "untitled"]


class AsJson:
    """Annotation of an argument that is checked later: JSON, with the schema of another type."""

    def __init__(self, kind: Any) -> None:  # noqa: ANN401 - any annotation
        """Have the schema of `kind`."""
        self._kind = kind

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate as the annotated type."""
        return handler(source)

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Show the other type."""
        return handler(TypeAdapter(self._kind).core_schema)


def document_schema(fleet: EnvironmentConfig) -> dict[str, Any]:
    """Schema of a mission document as agents write it, for the drones of `fleet`."""
    return bounded(documents.document_schema(), fleet)


def bounded(schema: Mapping[str, Any], fleet: EnvironmentConfig) -> dict[str, Any]:
    """A schema whose waypoints are in the tools' frame, with the names and bounds of a fleet.

    Args:
        schema: Schema with pydantic's definitions of a mission document, or of parts of one.
        fleet: The fleet's catalogue.
    """
    found: dict[str, Any] = {**untitled(schema), "additionalProperties": False}
    definitions: dict[str, Any] = found.get("$defs", {})
    if "Waypoint" in definitions:
        _bound_waypoint(definitions["Waypoint"], fleet)
    if "AnalysisEntry" in definitions:
        # Nobody is at the user's side of an agent.
        del definitions["AnalysisEntry"]["properties"]["here"], definitions["HereEntry"]
    for holder in (found, *definitions.values()):
        robot = holder.get("properties", {}).get("robot")
        if robot is not None:
            robot["enum"] = [one.id for one in fleet.robots]
    return found


def untitled(schema: Any) -> Any:  # noqa: ANN401 - JSON
    """A copy of a schema without titles, which repeat the fields' names."""
    if isinstance(schema, Mapping):
        return {
            key: untitled(value)
            for key, value in schema.items()
            if key != "title" or not isinstance(value, str)
        }
    return [untitled(one) for one in schema] if isinstance(schema, list) else schema


def _bound_waypoint(waypoint: dict[str, Any], fleet: EnvironmentConfig) -> None:
    waypoint["description"] = "A place to fly to."
    fields = waypoint["properties"]
    del fields["yaw"]
    fields["x"]["description"] = f"Metres east of home. {_sides(fleet, 0)}"
    fields["y"]["description"] = f"Metres north of home. {_sides(fleet, 1)}"
    fields["z"]["description"] = f"Metres above home. {_heights(fleet)}"
    fields["hover_duration"]["description"] = "Seconds to stay after arrival."
    fields["speed"]["description"] = f"m/s towards it. {_speeds(fleet)}"
    fields["speed"]["anyOf"][0]["maximum"] = max(one.limits.max_speed for one in fleet.robots)
    fields["deadline"]["description"] = "Seconds of mission time by which to arrive."
    fields["above"]["description"] = "What z is counted from: `home`, `sea` or `ground`."
    fields["waypoint_type"] = {"enum": list(WAYPOINT_TYPES), "default": WAYPOINT_TYPES[0]}
    fields[HEADING] = {
        "anyOf": [{"type": "number", "minimum": 0, "maximum": 360}, {"type": "null"}],
        "default": None,
        "description": "Where the nose points on arrival: 0 north, 90 east. Default: ahead.",
    }


def _sides(fleet: EnvironmentConfig, axis: int) -> str:
    def side(robot: RobotConfig) -> str:
        fence = robot.limits.geofence
        along = [corner[axis] for corner in fence.polygon]
        reach = robot.limits.max_range
        if not along:
            return f"{robot.id}: at most {reach:g} from its start"
        return f"{robot.id}: {min(along) + fence.margin:g} to {max(along) - fence.margin:g}"

    return "; ".join(map(side, fleet.robots))


def _heights(fleet: EnvironmentConfig) -> str:
    fences = ((robot.id, robot.limits.geofence) for robot in fleet.robots)
    return "; ".join(f"{name}: {one.floor:g} to {one.ceiling:g}" for name, one in fences)


def _speeds(fleet: EnvironmentConfig) -> str:
    return "; ".join(
        f"{robot.id}: up to {robot.limits.max_speed:g}, else {robot.limits.cruise_speed:g}"
        for robot in fleet.robots
    )
