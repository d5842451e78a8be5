"""Items of streams as JSON, between processes that do not trust each other.

A message is `{"is": CLASS, "of": FIELDS}`, whose fields are as `aerodaas.messages.schema` has them.
Nothing is a pickle. What is of another class becomes a OpaqueItem, whose content stays with its
author.
"""

from __future__ import annotations

import base64
import enum
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import BatteryOutlook, Decision, MissionState, MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.opaque_item import OpaqueItem
from aerodaas.messages.payload import GimbalAttitude
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.schema import MessageError, json_of, message_of
from aerodaas.messages.vehicle import FlightEnd, Traffic, VehicleMode, VehicleState
from aerodaas.messages.waypoints import (
    FollowedTarget,
    HeightReference,
    NavigationType,
    SchedulingType,
    TargetState,
    VelocityCommand,
    Waypoint,
    WaypointType,
)

__all__ = ["KNOWN_CLASSES", "decoded", "encoded"]

KNOWN_CLASSES: dict[str, type] = {
    one.__name__: one
    for one in (
        Alert,
        Battery,
        BatteryOutlook,
        CameraModel,
        Decision,
        Detection,
        Detections,
        FollowedTarget,
        GimbalAttitude,
        GpsFix,
        Header,
        MissionStatus,
        Odometry,
        Readings,
        Traffic,
        VehicleState,
        VelocityCommand,
        Waypoint,
    )
}
"""Classes of messages that may be sent, by name."""
_ENUMERATIONS: dict[str, type[enum.Enum]] = {
    one.__name__: one
    for one in (
        FlightEnd,
        HeightReference,
        MissionState,
        NavigationType,
        SchedulingType,
        TargetState,
        VehicleMode,
        WaypointType,
    )
}
"""Enumerations whose members may be sent outside a message's field, by name."""
_DEEPEST = 12
_LONGEST = 100_000
"""Most parts of one item."""
_KINDS = "biuf"
_PLAIN = frozenset({bool, int, float, str})
_NOT_FINITE = ("nan", "inf", "-inf")
_LONGEST_NAME = 64


class _UnknownError(Exception):
    """An object is of a class that is not known."""


def encoded(item: object, opaque: Callable[[object], OpaqueItem]) -> Any:  # noqa: ANN401 - JSON
    """Write an item as JSON.

    Args:
        item: A message, navigation that is no stream, a plain value, or a container of these.
        opaque: Wraps an item of another class.

    Returns:
        A value of the types that JSON has.

    Raises:
        MessageError: If a field of a message holds what JSON cannot.
    """
    try:
        return _written(item)
    except (_UnknownError, RecursionError):
        return _hidden(opaque(item))


def _hidden(item: OpaqueItem) -> dict[str, Any]:
    data = base64.b64encode(item.data).decode()
    return {"is": "OpaqueItem", "kind": item.kind, "value": item.value, "data": data}


def _written(item: object) -> Any:  # noqa: ANN401 - JSON
    if isinstance(item, np.generic):
        item = item.item()
    if type(item) is float and not math.isfinite(item):
        # JSON has no such numbers, and strict readers refuse what Python writes for them.
        return {"is": "float", "of": repr(item)}
    if type(item) is list:
        return [_written(one) for one in item]
    if item is None or type(item) in _PLAIN:
        return item
    if isinstance(item, OpaqueItem):
        return _hidden(item)
    return _tagged(item)


def _tagged(item: object) -> dict[str, Any]:
    name = type(item).__name__
    content: Any = None
    if KNOWN_CLASSES.get(name) is type(item):
        content = json_of(item)
    elif isinstance(item, enum.Enum) and _ENUMERATIONS.get(name) is type(item):
        content = item.value
    # A tuple of a class of its own, a named one, has more than its parts.
    elif type(item) is tuple:
        content = [_written(one) for one in item]
    elif type(item) is dict and all(isinstance(key, str) for key in item):
        content = {key: _written(one) for key, one in item.items()}
    elif isinstance(item, bytes):
        content = base64.b64encode(item).decode()
    return _of_own_form(item) if content is None else {"is": name, "of": content}


def _of_own_form(item: object) -> dict[str, Any]:
    """Write what has more than a class and a content."""
    if isinstance(item, AeroNavigation) and item.stream is None:
        return {
            "is": "AeroNavigation",
            "of": [_written(one) for one in item],
            "type": item.navigation_type.value,
            "scheduling": item.scheduling_type.value,
            "priority": item.priority,
        }
    # A class of its own, such as a masked array, has more than its numbers.
    if type(item) is np.ndarray and item.dtype.kind in _KINDS:
        data = base64.b64encode(item.tobytes()).decode()
        return {"is": "array", "type": item.dtype.str, "shape": item.shape, "data": data}
    raise _UnknownError


def decoded(content: Any) -> Any:  # noqa: ANN401 - JSON to any item
    """Rebuild an item from another process' JSON.

    Args:
        content: The JSON value, which may be a stranger's.

    Returns:
        The item; each field of a message is checked.

    Raises:
        MessageError: If it is malformed, too deep or too large, or of a class that is not known.
    """
    try:
        return _Reader().read(content)
    except MessageError:
        raise
    except Exception as error:  # noqa: BLE001 - a stranger's numbers in any constructor
        raise MessageError(f"malformed item: {type(error).__name__}: {error}"[:300]) from None


class _Reader:
    """Reader of one item, which counts its parts."""

    def __init__(self) -> None:
        self._parts = 0

    def read(self, content: Any, depth: int = 0) -> Any:  # noqa: ANN401 - JSON
        self._count(_DEEPEST - depth)
        if content is None or isinstance(content, bool | int | float | str):
            return content
        if isinstance(content, list):
            return [self.read(one, depth + 1) for one in content]
        kind = content.get("is") if isinstance(content, dict) else None
        return self._tagged(kind, content, depth)

    def _tagged(self, kind: Any, content: Any, depth: int) -> Any:  # noqa: ANN401 - JSON
        if kind in KNOWN_CLASSES:
            self._count_plain(content["of"], 2 * _DEEPEST - depth)
            return message_of(KNOWN_CLASSES[kind], content["of"])
        if kind == "tuple":
            return tuple(self.read(one, depth + 1) for one in content["of"])
        if kind == "dict":
            return {key: self.read(one, depth + 1) for key, one in content["of"].items()}
        if kind == "AeroNavigation":
            return _navigation(content, self.read(content["of"], depth + 1))
        if kind == "OpaqueItem":
            return self._opaque_item(content, depth)
        return _leaf(kind, content)

    def _opaque_item(self, content: Mapping[str, Any], depth: int) -> OpaqueItem:
        name = content["kind"]
        if not isinstance(name, str) or not name.isidentifier():
            raise MessageError("a class without a name")
        self._count_plain(content["value"], 2 * _DEEPEST - depth)
        data = base64.b64decode(content["data"], validate=True)
        return OpaqueItem(name[:_LONGEST_NAME], content["value"], data)

    def _count_plain(self, value: Any, levels: int) -> None:  # noqa: ANN401 - JSON
        self._count(levels)
        if isinstance(value, dict | list):
            for one in value.values() if isinstance(value, dict) else value:
                self._count_plain(one, levels - 1)

    def _count(self, levels: int) -> None:
        """Count one part, which may have so many levels below it."""
        self._parts += 1
        if levels < 0 or self._parts > _LONGEST:
            raise MessageError(f"too many levels, or more than {_LONGEST} parts, in one item")


def _leaf(kind: Any, content: Any) -> Any:  # noqa: ANN401 - JSON to a value without items within
    inner = content.get("of") if isinstance(content, dict) else None
    if kind == "float" and inner in _NOT_FINITE:
        return float(inner)
    if kind in _ENUMERATIONS:
        return _ENUMERATIONS[kind](inner)
    if kind == "bytes" and isinstance(inner, str):
        return base64.b64decode(inner, validate=True)
    if kind == "array":
        return _array(content)
    raise MessageError(f"there is no class {str(kind)[:40]!r} that may be sent")


def _navigation(content: Mapping[str, Any], items: list[Any]) -> AeroNavigation:
    priority = content["priority"]
    if not (priority is None or type(priority) is int):
        raise MessageError("navigation of a priority that is no number")
    return AeroNavigation(
        NavigationType(content["type"]),
        items,
        SchedulingType(content["scheduling"]),
        priority=priority,
    )


def _array(content: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    kind = np.dtype(str(content["type"])[:8])
    if kind.kind not in _KINDS:
        raise MessageError(f"an array of {kind}")
    shape = [int(one) for one in content["shape"]]
    whole = base64.b64decode(content["data"], validate=True)
    if len(shape) > _DEEPEST or any(one < 0 for one in shape):
        raise MessageError("an array of an impossible shape")
    return np.frombuffer(whole, kind).reshape(shape)
