"""Messages of earlier formats in the present shape.

Format 1 is that of recordings without a number: until version 0.1.0 was released.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

__all__ = ["conversions"]

Conversion = Callable[[dict[str, Any]], dict[str, Any]]


def conversions(recorded_format: str) -> Mapping[str, Conversion]:
    """Conversions to the present shape.

    Args:
        recorded_format: The recording's metadata `format`; empty where it has none.

    Returns:
        By name of the schema, for those whose shape has changed; a conversion may raise KeyError,
        TypeError or ValueError for what is malformed.
    """
    return _FROM_1 if recorded_format in {"", "1"} else {}


def _with_header(value: dict[str, Any]) -> dict[str, Any]:
    """A message whose header's fields stood among its own; alerts had no number."""
    stamp, source = value["stamp"], value["source"]
    return {**value, "header": {"id": value.get("id", 0), "stamp": stamp, "source": source}}


def _detections(value: dict[str, Any]) -> dict[str, Any]:
    """A detection whose score or box is not known was written, too, and is left out."""
    items = [one for one in value["items"] if one["score"] is not None and None not in one["box"]]
    return _with_header({**value, "items": items})


def _vehicle_state(value: dict[str, Any]) -> dict[str, Any]:
    """A receiver that does not know its number of satellites told any number, or none."""
    gps = value.get("gps")
    if not isinstance(gps, dict) or type(gps.get("satellites")) is int:
        return value
    return {**value, "gps": {**gps, "satellites": 0}}


def _mission_status(value: dict[str, Any]) -> dict[str, Any]:
    """The number of waypoints ahead was `pending`; early ones name all visits and count nothing."""
    pending = value.get("pending")
    ahead = pending if type(pending) is int and pending > 0 else 0
    kept = {name: one for name, one in value.items() if name != "pending"}
    visited = len(set(value["visited"]))
    known = visited + ahead + (value.get("target") is not None)
    counts = {"visits": len(value["visited"]), "waypoint_counts": [visited, known]}
    return {**counts, **kept, "ahead": ahead}


def _plan(value: dict[str, Any]) -> dict[str, Any]:
    return {"stamp": 0, **value}


def _vitals(value: dict[str, Any]) -> dict[str, Any]:
    """Memory was in megabytes, and the time of the reading was the message's."""
    memory = round(value["memory_mb"] * 1e6)
    known = {"taken": 0, "cpu_seconds": 0.0, "cpu_cores": None, "gpus": []}
    return {**known, **value, "memory": memory}


_FROM_1: Mapping[str, Conversion] = {
    "aerodaas.VehicleState": _vehicle_state,
    "aerodaas.MissionStatus": _mission_status,
    "aerodaas.Plan": _plan,
    "aerodaas.Frame": _with_header,
    "aerodaas.Detections": _detections,
    "aerodaas.Navigation": _with_header,
    "aerodaas.Value": _with_header,
    "aerodaas.Alert": _with_header,
    "aerodaas.Vitals": _vitals,
}
