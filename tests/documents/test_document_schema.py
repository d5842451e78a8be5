"""JSON schema of mission documents: what it accepts, refuses and describes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from aerodaas.config.plugins import plugin_names
from aerodaas.documents.schema import analysis_arguments, document_schema
from aerodaas.environment.document.flying import compile_application
from aerodaas.errors import UnknownIdError

APPS = Path(__file__).resolve().parents[2] / "apps"
FLYING = (
    "disaster_survey",
    "farm_survey",
    "fleet_survey",
    "search_and_rescue",
    "situation_awareness",
    "tower_inspection",
    "vehicle_tracking",
)
SCHEMA = document_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def document(**parts: Any) -> dict[str, Any]:  # noqa: ANN401
    """A document with these parts."""
    return {"format": "aerodaas-mission", "version": 1, **parts}


def analysed(name: str, **settings: Any) -> dict[str, Any]:  # noqa: ANN401
    """A document with one analysis."""
    return document(analyses=[{"id": "drone/it", "analysis": name, "settings": settings}])


def navigated(**waypoint: Any) -> dict[str, Any]:  # noqa: ANN401
    """A document with one waypoint."""
    stop = {"id": "a", "x": 1, "y": 2, "z": 3, **waypoint}
    return document(navigation=[{"robot": "drone", "waypoints": [stop]}])


def test_the_schema_is_a_schema() -> None:
    """By the dialect that it names, and as JSON without numbers that JSON lacks."""
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    json.dumps(SCHEMA, allow_nan=False)


@pytest.mark.parametrize("name", FLYING)
def test_what_applications_compile_to_is_valid(name: str) -> None:
    """Each that ships and that a document can hold."""
    VALIDATOR.validate(json.loads(compile_application(APPS / f"{name}.py", []).text()))


@pytest.mark.parametrize(
    "content",
    [
        analysed("PersonFollowAnalytics", distance=3, gains={"$settings": "FollowGains", "of": {}}),
        analysed("CrowdDensityAnalytics", detector={"$analysis": "OnnxDetector", "settings": {}}),
        analysed("GpsLoggerAnalytics", source={"$property": ["log", "path"]}),
        navigated(yaw=None, above="sea", actions=[{"type": "take_photo"}]),
        document(trajectory_scheduler={"name": "optimal", "settings": {"budget": 1}}),
    ],
)
def test_what_a_document_can_hold_is_accepted(content: dict[str, Any]) -> None:
    """Settings, analyses within analyses, properties, heights, actions and schedulers."""
    VALIDATOR.validate(content)


@pytest.mark.parametrize(
    "content",
    [
        document(navigatoin=[]),
        analysed("PersonFolowAnalytics"),
        analysed("PersonFollowAnalytics", distnace=3),
        analysed("PersonFollowAnalytics", distance="3"),
        analysed("PersonFollowAnalytics", distance=-3),
        analysed("PersonFollowAnalytics", gains={"$settings": "FollowGains", "of": {"yo": 1}}),
        analysed("PersonFollowAnalytics", gains={"$settings": "LostPolicy", "of": {}}),
        analysed(
            "CrowdDensityAnalytics",
            detector={"$analysis": "OnnxDetector", "settings": {"min_scor": 1}},
        ),
        analysed("OnnxDetector", path="/etc/passwd"),
        analysed("GpsLoggerAnalytics"),
        document(analyses=[{"id": "drone/it", "analysis": "GpsLoggerAnalytics"}]),
        document(trajectory_scheduler={"name": "optimal", "settings": {"buget": 1}}),
        document(analytics_scheduler="demms"),
        navigated(above="moon"),
        navigated(actions=[{"type": "land"}]),
        navigated(hieght=3),
    ],
)
def test_what_is_misspelled_or_out_of_range_is_refused(content: dict[str, Any]) -> None:
    """Names of parts, analyses, settings and schedulers; types and ranges of values."""
    assert not VALIDATOR.is_valid(content)


def properties(schema: Any, place: str = "") -> Iterator[tuple[str, dict[str, Any]]]:  # noqa: ANN401
    """All properties that a schema describes, by where they stand; conditions are none."""
    if isinstance(schema, list):
        for number, one in enumerate(schema):
            yield from properties(one, f"{place}/{number}")
    if not isinstance(schema, dict):
        return
    for name, one in schema.get("properties", {}).items():
        yield f"{place}/{name}", one
    for name, one in schema.items():
        if name != "allOf":
            yield from properties(one, f"{place}/{name}")


def test_each_property_is_described() -> None:
    """By a sentence, so that whoever writes a document knows what it means."""
    bare = [place for place, one in properties(SCHEMA) if not one.get("description")]
    assert bare == []


def test_arguments_have_type_default_range_and_description() -> None:
    """Of an analysis alone, as a catalogue shows them."""
    arguments = analysis_arguments("CarFollowAnalytics")["properties"]
    distance = arguments["distance"]
    assert (distance["type"], distance["default"]) == ("number", 6.0)
    assert distance["exclusiveMinimum"] == 0
    assert "metres" in distance["description"]
    assert all(analysis_arguments(name) for name in plugin_names("analytics"))
    with pytest.raises(UnknownIdError, match="CarFollowAnalytics"):
        analysis_arguments("CarFolowAnalytics")
