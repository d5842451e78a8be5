"""Write the JSON schema of what the console and a service say to each other.

`python -m tools.wire_schema` writes it to `console/wire.schema.json`, from which the page's own
types are made.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import JsonSchemaMode

from aerodaas.mission.commands import Answer
from aerodaas.protocol.piloting import ControlsOut, RearrangeIn, SteerIn, SurveyIn, SurveyOut
from aerodaas.protocol.playback import PlaybackOut
from aerodaas.protocol.preflight import PreflightOut
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
    FleetOut,
    MissionOut,
    PlaybackOut,
    PreflightOut,
    RefusalOut,
    SceneryOut,
    SurveyOut,
)
_IN: tuple[type, ...] = (CommandIn, NavigationIn, RearrangeIn, SteerIn, SurveyIn)


def schema_text() -> str:
    """The schema: an object with a property for each message."""
    answers = _definitions(_OUT, "serialization")
    for model in answers.values():
        if "properties" in model:
            # An answer has all its fields, those of a default value included.
            model["required"] = sorted(model["properties"])
    names = [one.__name__ for one in (*_OUT, *_IN)]
    whole = {
        "title": "Wire",
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
    for model in found.values():
        for field in model.get("properties", {}).values():
            # Each would become a type of its own.
            field.pop("title", None)
    return found


def _plain(content: Any) -> Any:  # noqa: ANN401 - JSON
    """Tuples as the makers of TypeScript know them: `items` instead of `prefixItems`."""
    if isinstance(content, list):
        return [_plain(one) for one in content]
    if isinstance(content, dict):
        words = {"prefixItems": "items"}
        return {words.get(key, key): _plain(one) for key, one in content.items()}
    return content


if __name__ == "__main__":
    SCHEMA.write_text(schema_text(), encoding="utf-8")
