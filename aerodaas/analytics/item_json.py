"""Items as data: written in one process, and checked in another that does not trust it.

An item is JSON of known classes, never a pickle: each field is checked against the annotation of
its class. What is of another class becomes a GuestItem, whose content stays with its author.
"""

from __future__ import annotations

import base64
import dataclasses
import enum
import math
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from aerodaas.config.annotations import is_subclass
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import AeroDaaSError
from aerodaas.geometry import frames as geometry
from aerodaas.messages import (
    detections,
    frames,
    mission,
    odometry,
    payload,
    readings,
    vehicle,
    waypoints,
)
from aerodaas.messages.guest_item import GuestItem
from aerodaas.messages.records import secrets_of

__all__ = ["KNOWN_CLASSES", "ItemError", "decoded", "encoded"]

KNOWN_CLASSES: dict[str, type] = {
    one.__name__: one
    for one in (
        readings.Alert,
        odometry.Battery,
        detections.Detection,
        detections.Detections,
        odometry.GpsFix,
        frames.Header,
        odometry.Odometry,
        readings.Readings,
        geometry.CameraModel,
        payload.GimbalAttitude,
        mission.BatteryOutlook,
        mission.Decision,
        mission.MissionStatus,
        waypoints.FollowedTarget,
        vehicle.Traffic,
        vehicle.VehicleState,
        waypoints.VelocityCommand,
        waypoints.Waypoint,
    )
}
"""Classes whose objects are written field by field, by name."""
_KNOWN_ENUMS: dict[str, type[enum.Enum]] = {
    one.__name__: one
    for one in (
        mission.MissionState,
        waypoints.TargetState,
        vehicle.FlightEnd,
        vehicle.VehicleMode,
        waypoints.HeightReference,
        waypoints.NavigationType,
        waypoints.SchedulingType,
        waypoints.WaypointType,
    )
}
"""Enumerations whose members are written by name of the class, where no field's annotation says
which it is."""
_DEEPEST = 12
_LONGEST = 100_000
"""Most parts of one item."""
_KINDS = "biuf"
_NOT_FINITE = ("nan", "inf", "-inf")
_PLAIN = (bool, int, float, str, type(None))


class ItemError(AeroDaaSError):
    """An item is malformed, or of a class that is not known here."""


class _UnknownError(Exception):
    """An object of a class that is not known."""


def encoded(item: object, opaque: Callable[[object], GuestItem]) -> Any:  # noqa: ANN401 - JSON
    """Write an item as JSON; `opaque` wraps one of a class that is not known."""
    try:
        return _write(item)
    except (_UnknownError, RecursionError):
        return _opaque(opaque(item))


def _plain(item: object) -> Any:  # noqa: ANN401 - JSON
    if isinstance(item, float) and not math.isfinite(item):
        # JSON has no such numbers, and strict readers refuse what Python writes for them.
        return {"is": "float", "of": repr(item)}
    return item


def _opaque(hidden: GuestItem) -> dict[str, Any]:
    content = _text(hidden.data)
    return {"is": "GuestItem", "kind": hidden.kind, "value": hidden.value, "data": content}


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _data(text: str) -> bytes:
    return base64.b64decode(text, validate=True)


def _leaf(item: bytes | enum.Enum | np.ndarray[Any, Any]) -> dict[str, Any]:
    """Write what has no items within, but is not one of JSON's own."""
    if isinstance(item, bytes):
        return {"is": "bytes", "of": _text(item)}
    if isinstance(item, enum.Enum):
        name = type(item).__name__
        if _KNOWN_ENUMS.get(name) is not type(item):
            raise _UnknownError
        return {"is": name, "of": item.value}
    # A class of its own, such as a masked array, has more than its numbers.
    if type(item) is not np.ndarray or item.dtype.kind not in _KINDS:
        raise _UnknownError
    whole = _text(np.ascontiguousarray(item).tobytes())
    return {"is": "array", "type": item.dtype.str, "shape": item.shape, "data": whole}


def _field(item: object) -> Any:  # noqa: ANN401 - JSON
    """Write what is in a field, whose annotation tells of which enumeration a value is."""
    return _write(item.value if isinstance(item, enum.Enum) else item)


def _write(item: object) -> Any:  # noqa: ANN401 - JSON
    if isinstance(item, np.generic):
        item = item.item()
    if type(item) in _PLAIN:
        return _plain(item)
    if isinstance(item, bytes | enum.Enum | np.ndarray):
        return _leaf(item)
    name = type(item).__name__
    content: list[Any] | dict[str, Any] | None = None
    if type(item) in {list, tuple}:
        content = [_write(one) for one in typing.cast("list[object]", item)]
    elif type(item) is dict and all(isinstance(key, str) for key in item):
        content = {key: _write(one) for key, one in item.items()}
    elif KNOWN_CLASSES.get(name) is type(item):
        content = {one: _field(getattr(item, one)) for one in _shown_names(KNOWN_CLASSES[name])}
    elif isinstance(item, AeroNavigation) and item.stream is None:
        return {
            "is": "AeroNavigation",
            "of": [_write(one) for one in item],
            "type": item.navigation_type.value,
            "scheduling": item.scheduling_type.value,
            "priority": item.priority,
        }
    elif isinstance(item, GuestItem):
        return _opaque(item)
    if content is None:
        raise _UnknownError
    return {"is": name, "of": content}


def decoded(content: Any) -> Any:  # noqa: ANN401 - JSON to any item
    """Rebuild an item from another process' JSON; raises ItemError if it is malformed."""
    try:
        return _Reader().read(content)
    except ItemError:
        raise
    except Exception as error:  # noqa: BLE001 - a stranger's numbers in any constructor
        raise ItemError(f"malformed item: {type(error).__name__}: {error}"[:300]) from None


class _Reader:
    """Reader of one item, which counts its parts."""

    def __init__(self) -> None:
        self._parts = 0

    def read(self, content: Any, depth: int = 0) -> Any:  # noqa: ANN401 - JSON
        self._parts += 1
        if depth > _DEEPEST or self._parts > _LONGEST:
            raise ItemError(f"more than {_DEEPEST} levels or {_LONGEST} parts in one item")
        if isinstance(content, _PLAIN):
            return content
        kind = content.get("is") if isinstance(content, dict) else None
        if kind == "array":
            return _array(content)
        if kind == "GuestItem":
            return self._hidden(content, depth)
        return self._inner(kind, content["of"] if kind is not None else None, content, depth)

    def _hidden(self, content: Mapping[str, Any], depth: int) -> GuestItem:
        name, hidden = content["kind"], _data(content["data"])
        if not isinstance(name, str) or not name.isidentifier():
            raise ItemError("a class without a name")
        self._limit_plain(content["value"], depth)
        return GuestItem(name[:64], content["value"], hidden)

    def _inner(self, kind: Any, inner: Any, content: Any, depth: int) -> Any:  # noqa: ANN401 - JSON
        if kind == "float" and inner in _NOT_FINITE:
            return float(inner)
        if kind == "bytes" and isinstance(inner, str):
            return _data(inner)
        if kind in _KNOWN_ENUMS:
            return _KNOWN_ENUMS[kind](inner)
        if kind in {"list", "tuple", "AeroNavigation"} and isinstance(inner, list):
            found = [self.read(one, depth + 1) for one in inner]
            if kind == "AeroNavigation":
                return _navigation(content, found)
            return found if kind == "list" else tuple(found)
        if isinstance(inner, dict) and (kind == "dict" or kind in KNOWN_CLASSES):
            fields = {key: self.read(one, depth + 1) for key, one in inner.items()}
            return fields if kind == "dict" else _built(KNOWN_CLASSES[kind], fields)
        raise ItemError(f"there is no class {str(kind)[:40]!r} that may be sent")

    def _limit_plain(self, value: Any, depth: int) -> None:  # noqa: ANN401 - JSON
        self._parts += 1
        if depth > 2 * _DEEPEST or self._parts > _LONGEST:
            raise ItemError("an object too large to be shown")
        if isinstance(value, dict | list):
            for one in value.values() if isinstance(value, dict) else value:
                self._limit_plain(one, depth + 1)


def _navigation(content: Mapping[str, Any], items: list[Any]) -> AeroNavigation:
    priority = content["priority"]
    if not _conforms(priority, int | None):
        raise ItemError("navigation of a priority that is no number")
    return AeroNavigation(
        waypoints.NavigationType(content["type"]),
        items,
        waypoints.SchedulingType(content["scheduling"]),
        priority=priority,
    )


def _array(content: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    kind = np.dtype(str(content["type"])[:8])
    if kind.kind not in _KINDS:
        raise ItemError(f"an array of {kind}")
    shape = [int(one) for one in content["shape"]]
    whole = _data(content["data"])
    if len(shape) > _DEEPEST or any(one < 0 for one in shape):
        raise ItemError("an array of an impossible shape")
    return np.frombuffer(whole, kind).reshape(shape)


def _built(kind: type, fields: dict[str, Any]) -> Any:  # noqa: ANN401 - an instance
    hints = _hints(kind)
    found = {}
    for name, value in fields.items():
        if name not in hints:
            raise ItemError(f"{kind.__name__} has no {name[:40]}")
        if not _conforms(value, hints[name]):
            raise ItemError(
                f"{kind.__name__}.{name} is of a wrong type: {type(value).__name__}, where it is "
                f"to be {_words(hints[name])}"
            )
        found[name] = _as_enum(value, hints[name])
    return kind(**found)


def _as_enum(value: Any, hint: Any) -> Any:  # noqa: ANN401 - an annotation
    """The member of an enumeration for its value, where the field is one; `value` otherwise."""
    kinds = [one for one in (hint, *typing.get_args(hint)) if is_subclass(one, enum.Enum)]
    return kinds[0](value) if kinds and value is not None else value


def _names(kind: type) -> tuple[str, ...]:
    fields: tuple[str, ...] | None = getattr(kind, "_fields", None)
    return fields or tuple(one.name for one in dataclasses.fields(kind))


@lru_cache(maxsize=64)
def _shown_names(kind: type) -> tuple[str, ...]:
    """Names of the fields that are no secrets."""
    return tuple(one for one in _names(kind) if one not in secrets_of(kind))


def _words(hint: Any) -> str:  # noqa: ANN401 - an annotation
    return hint.__name__ if type(hint) is type else str(hint)[:100]


@lru_cache(maxsize=64)
def _hints(kind: type) -> dict[str, Any]:
    found = typing.get_type_hints(kind)
    return {name: found[name] for name in _names(kind)}


def _resolved(hint: Any) -> Any:  # noqa: ANN401 - an annotation
    """What a named alias stands for, such as NumPy's `NDArray` from 2.5 on; `hint` otherwise."""
    # The class of such aliases is there from Python 3.12 on only.
    meant = getattr(typing.get_origin(hint), "__value__", None)
    return hint if meant is None else meant[typing.get_args(hint)]


_VECTOR: typing.Final = _resolved(geometry.Vector)


def _conforms(value: object, hint: Any) -> bool:  # noqa: ANN401 - an annotation
    hint = _resolved(hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Union or isinstance(hint, types.UnionType):
        return any(_conforms(value, one) for one in arguments)
    if origin is not None:
        return isinstance(value, origin) and _conform_inside(value, origin, hint)
    if hint is Any:
        return True
    if is_subclass(hint, enum.Enum):
        words: Iterable[enum.Enum] = hint
        return isinstance(value, str) and value in {one.value for one in words}
    if hint in {int, float} and isinstance(value, int):
        # JSON does not tell 1 from 1.0.
        most = 53 if hint is float else 63
        return not isinstance(value, bool) and abs(value) < 1 << most
    return isinstance(value, hint)


def _conform_inside(value: Any, origin: Any, hint: Any) -> bool:  # noqa: ANN401 - an annotation
    """Whether the parts of a tuple, dictionary or array are as its annotation says."""
    arguments = typing.get_args(hint)
    if origin is np.ndarray:
        return _fits(value, hint)
    if origin is dict:
        return _conform(tuple(value.values()), (arguments[1], ...))
    return _conform(value, arguments)


def _fits(array: np.ndarray[Any, Any], hint: Any) -> bool:  # noqa: ANN401 - an annotation
    """Whether an array is of the annotation's number type; for floats, any real numbers do."""
    if hint == _VECTOR and array.shape != (3,):
        return False
    wanted = np.dtype(typing.get_args(typing.get_args(hint)[1])[0])
    return array.dtype.kind in "iuf" if wanted.kind == "f" else array.dtype == wanted


def _conform(values: tuple[object, ...], hints: tuple[Any, ...]) -> bool:
    if hints[-1] is Ellipsis:
        return all(_conforms(one, hints[0]) for one in values)
    return len(values) == len(hints) and all(map(_conforms, values, hints))
