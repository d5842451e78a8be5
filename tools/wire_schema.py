"""Write the JSON schema of what the console and a service say to each other.

`python -m tools.wire_schema` writes it to `console/wire.schema.json`, from which the page's own
types are made.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, create_model
from pydantic.json_schema import JsonSchemaMode

from aerodaas.config.sections.robot import CameraConfig, LimitsConfig, RobotConfig
from aerodaas.extensions.surveys.messages import SurveyIn, SurveyOut
from aerodaas.messages.health import HealthReport
from aerodaas.mission.commands import Answer
from aerodaas.protocol.live import EndMessage, ItemMessage, LeftOutMessage, StateMessage
from aerodaas.protocol.piloting import ControlsOut, RearrangeIn, SteerIn
from aerodaas.protocol.playback import PlaybackOut
from aerodaas.protocol.proposals import ApprovalIn
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    AccountOut,
    CommandIn,
    FleetOut,
    MissionOut,
    NavigationIn,
    RefusalOut,
)

__all__ = ["SCHEMA", "schema_text"]

SCHEMA = Path(__file__).resolve().parents[1] / "console" / "wire.schema.json"
_OUT: tuple[type, ...] = (
    AccountOut,
    Answer,
    ControlsOut,
    EndMessage,
    FleetOut,
    ItemMessage,
    LeftOutMessage,
    MissionOut,
    PlaybackOut,
    HealthReport,
    RefusalOut,
    SceneryOut,
    StateMessage,
    SurveyOut,
)
_DRAWN = ("id", "sensors", "start")
_FIELDS: dict[str, Any] = {
    name: (RobotConfig.model_fields[name].annotation, ...) for name in _DRAWN
}
_HEEDED = ("battery_land", "cruise_speed", "geofence", "max_climb", "max_speed", "takeoff_height")
_LIMITS: dict[str, Any] = {
    name: (LimitsConfig.model_fields[name].annotation, ...) for name in _HEEDED
}
_FIELDS["limits"] = (
    create_model("LimitsConfig", __doc__="Limits, as far as the page heeds them.", **_LIMITS),
    ...,
)
_ROBOT = create_model(
    "RobotConfig", __doc__="One drone of an environment, as far as the page draws it.", **_FIELDS
)
_CONFIG: tuple[type, ...] = (CameraConfig, _ROBOT)
_IN: tuple[type, ...] = (ApprovalIn, CommandIn, NavigationIn, RearrangeIn, SteerIn, SurveyIn)


def schema_text() -> str:
    """The schema: an object with a property for each message."""
    # How a configuration is serialised, its secrets left out, no schema tells.
    answers = _definitions(_OUT, "serialization") | _definitions(_CONFIG, "validation")
    for model in answers.values():
        if "properties" in model:
            # An answer has all its fields, those of a default value included.
            model["required"] = sorted(model["properties"])
    names = [one.__name__ for one in (*_OUT, *_CONFIG, *_IN)]
    whole = {
        "type": "object",
        "additionalProperties": False,
        "required": names,
        "properties": {name: {"$ref": f"#/$defs/{name}"} for name in names},
        "$defs": answers | _definitions(_IN, "validation"),
    }
    return json.dumps(_plain(whole), indent=1, sort_keys=True) + "\n"


def _definitions(models: tuple[type, ...], mode: JsonSchemaMode) -> dict[str, Any]:
    _, schema = TypeAdapter.json_schemas([(model, mode, TypeAdapter(model)) for model in models])
    found: dict[str, Any] = schema["$defs"]
    return found


def _plain(content: Any) -> Any:  # noqa: ANN401 - JSON
    """A schema as the makers of TypeScript know it.

    Tuples have `items` instead of `prefixItems`. No part has a title, which would be a type.
    """
    if isinstance(content, list):
        return [_plain(one) for one in content]
    if isinstance(content, dict):
        words = {"prefixItems": "items"}
        return {
            words.get(key, key): _plain(one)
            for key, one in content.items()
            if key != "title" or not isinstance(one, str)
        }
    return content


if __name__ == "__main__":
    SCHEMA.write_text(schema_text(), encoding="utf-8")
