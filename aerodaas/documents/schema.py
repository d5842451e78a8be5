"""JSON schema of mission documents, with the arguments of each analysis that is registered here.

An editor completes by it, a program writes by it, and what the check would refuse for its form is
refused by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from aerodaas.config.model import TaskConfig
from aerodaas.config.plugins import PluginKind, load_plugin, plugin_names
from aerodaas.dataflow.mission_document import (
    HERE_CONDITION,
    AnalysisEntry,
    HereEntry,
    MissionDocument,
    NavigationDocument,
    SchedulerEntry,
    TriggerEntry,
)
from aerodaas.documents.arguments import (
    AnalysisValue,
    argument_model,
    class_texts,
    condition_adapter,
)
from aerodaas.errors import AeroDaaSError, UnknownIdError
from aerodaas.messages.actions import action_kinds
from aerodaas.messages.waypoints import Waypoint

__all__ = ["analysis_arguments", "document_schema"]

_Schema: TypeAlias = dict[str, Any]
_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_REFERENCE = "#/$defs/{model}"


class _Generator(GenerateJsonSchema):
    """Schemas without titles, which only repeat the names."""

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ANN401 - as pydantic's
        del schema
        return False


def document_schema() -> _Schema:
    """The schema of mission documents, by which editors complete them and programs write them."""
    models = _argument_models("analytics")
    schedulers = _argument_models("trajectory_schedulers")
    parts = [MissionDocument, TaskConfig, AnalysisValue, *models.values(), *schedulers.values()]
    _, whole = models_json_schema(
        [(one, "validation") for one in parts],
        by_alias=True,
        ref_template=_REFERENCE,
        schema_generator=_Generator,
    )
    found: _Schema = whole["$defs"]
    condition = condition_adapter().json_schema(
        ref_template=_REFERENCE, schema_generator=_Generator
    )
    found |= condition.pop("$defs", {})
    _describe(found)
    _bind(found["AnalysisEntry"], "analysis", models)
    _bind(found["AnalysisValue"], "$analysis", models)
    _bind(found["SchedulerEntry"], "name", schedulers)
    entry = found["AnalysisEntry"]["properties"]
    entry["task"]["anyOf"] = [{"$ref": "#/$defs/TaskConfig"}, {"type": "null"}]
    number = {"type": "integer", "description": "Place of the trigger in its list, from 0."}
    here = {"type": "object", "properties": {HERE_CONDITION: number}}
    here |= {"required": [HERE_CONDITION], "additionalProperties": False}
    when = found["TriggerEntry"]["properties"]["when"]
    when["anyOf"] = [*condition["anyOf"], here]
    document: _Schema = found.pop("MissionDocument")
    names = plugin_names("analytics_schedulers")
    chosen = document["properties"]["analytics_scheduler"]
    chosen["anyOf"] = [{"enum": names}, {"type": "null"}]
    waypoint = found["Waypoint"]["properties"]
    waypoint["waypoint_type"] = _only_enumerated(waypoint["waypoint_type"])
    waypoint["above"] = _only_enumerated(waypoint["above"])
    return {
        "$schema": _DIALECT,
        "title": "AeroDaaS mission document",
        **document,
        "$defs": dict(sorted(found.items())),
    }


def analysis_arguments(name: str) -> _Schema:
    """JSON schema of the arguments of one analysis: type, default, range, description with units.

    Raises:
        UnknownIdError: If no analysis of this name is registered.
    """
    if name not in plugin_names("analytics"):
        raise UnknownIdError("analysis", name, plugin_names("analytics"))
    model = argument_model("analytics", name)
    return model.model_json_schema(by_alias=True, schema_generator=_Generator)


def _argument_models(kind: PluginKind) -> dict[str, type[BaseModel]]:
    """Models of the arguments of all plug-ins that can be loaded here, by name."""
    found = {}
    for name in plugin_names(kind):
        model = _loaded(kind, name)
        if model is not None:
            found[name] = model
    return found


def _loaded(kind: PluginKind, name: str) -> type[BaseModel] | None:
    try:
        load_plugin(kind, name)
    except AeroDaaSError:
        # A package whose own packages are missing here.
        return None
    return argument_model(kind, name)


def _bind(entry: _Schema, key: str, models: Mapping[str, type[BaseModel]]) -> None:
    """Give the settings of an entry those of what `key` names."""
    names = sorted(models)
    text = entry["properties"][key].get("description", "")
    optional = key not in entry.get("required", ())
    choices: _Schema = {"enum": [*names, None] if optional else names}
    entry["properties"][key] = {**choices, "description": text}
    entry["allOf"] = [
        {
            "if": {"properties": {key: {"const": name}}, "required": [key]},
            "then": {
                "properties": {"settings": {"$ref": f"#/$defs/{name}"}},
                "required": ["settings"] if _needs_settings(models[name]) else [],
            },
        }
        for name in names
    ]


def _needs_settings(model: type[BaseModel]) -> bool:
    return any(field.is_required() for field in model.model_fields.values())


def _describe(found: _Schema) -> None:
    """Give each property of the document's own parts its description."""
    kinds = [AnalysisEntry, HereEntry, MissionDocument, NavigationDocument, SchedulerEntry]
    for kind in (*kinds, TriggerEntry, Waypoint, TaskConfig, *action_kinds().values()):
        properties = found[kind.__name__]["properties"]
        for name, text in class_texts(kind).items():
            if name in properties:
                properties[name]["description"] = text
        if "type" in properties:
            properties["type"].setdefault("description", "Kind of the action.")


def _only_enumerated(choices: _Schema) -> _Schema:
    """Choices without free text, which Python code alone may give."""
    kept = [one for one in choices["anyOf"] if one != {"type": "string"}]
    return {**choices, "anyOf": kept}
