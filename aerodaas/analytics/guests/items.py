"""Items as data: results of a guest, written in its process and checked in its owner's.

A result is JSON of known classes, never a pickle: each field is checked against the annotation of
its class. What is of another class becomes a GuestItem, whose content stays with its guest.
"""

from __future__ import annotations

import base64
import dataclasses
import enum
import types
import typing
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.types import data, geometry, waypoints
from aerodaas.types.errors import AeroDaaSError
from aerodaas.types.guest_item import GuestItem

__all__ = ["ItemError", "decoded", "encoded"]

_CLASSES: dict[str, type] = {
    one.__name__: one
    for one in (
        data.Battery,
        data.Detection,
        data.Detections,
        data.GpsFix,
        data.Header,
        data.Odometry,
        data.Readings,
        geometry.CameraModel,
        waypoints.VelocityCommand,
        waypoints.Waypoint,
    )
}
_DEEPEST = 12
_LONGEST = 100_000
"""Most parts of one item."""
_KINDS = "biuf"
_PLAIN = (bool, int, float, str, type(None))


class ItemError(AeroDaaSError):
    """A guest's result is malformed."""


class _UnknownError(Exception):
    """An object of a class that is not known."""


def encoded(item: object, opaque: Callable[[object], GuestItem]) -> Any:  # noqa: ANN401 - JSON
    """Write an item as JSON; `opaque` wraps one of a class that is not known."""
    try:
        return _write(item)
    except (_UnknownError, RecursionError):
        hidden = opaque(item)
        content = base64.b64encode(hidden.data).decode()
        return {"is": "GuestItem", "kind": hidden.kind, "value": hidden.value, "data": content}


def _write(item: object) -> Any:  # noqa: ANN401 - JSON
    if isinstance(item, enum.Enum | np.generic):
        item = item.value if isinstance(item, enum.Enum) else item.item()
    if type(item) in _PLAIN:
        return item
    name = type(item).__name__
    content: list[Any] | dict[str, Any] | None = None
    if type(item) in {list, tuple}:
        content = [_write(one) for one in typing.cast("list[object]", item)]
    elif type(item) is dict and all(isinstance(key, str) for key in item):
        content = {key: _write(one) for key, one in item.items()}
    elif _CLASSES.get(name) is type(item):
        content = {one: _write(getattr(item, one)) for one in _names(type(item))}
    elif isinstance(item, AeroNavigation) and item.stream is None:
        inner = [_write(one) for one in item]
        return {"is": "AeroNavigation", "of": inner, "scheduling": item.scheduling_type.value}
    elif isinstance(item, np.ndarray) and item.dtype.kind in _KINDS:
        whole = base64.b64encode(np.ascontiguousarray(item).tobytes()).decode()
        return {"is": "array", "type": item.dtype.str, "shape": item.shape, "data": whole}
    if content is None:
        raise _UnknownError
    return {"is": name, "of": content}


def decoded(content: Any) -> Any:  # noqa: ANN401 - JSON to any item
    """Rebuild an item from a guest's JSON; raises ItemError if it is malformed."""
    try:
        return _Reader().read(content)
    except ItemError:
        raise
    except Exception as error:  # noqa: BLE001 - a stranger's numbers in any constructor
        raise ItemError(f"malformed result: {type(error).__name__}: {error}"[:300]) from None


class _Reader:
    """Reader of one item, which counts its parts."""

    def __init__(self) -> None:
        self._parts = 0

    def read(self, content: Any, depth: int = 0) -> Any:  # noqa: ANN401 - JSON
        self._parts += 1
        if depth > _DEEPEST or self._parts > _LONGEST:
            raise ItemError(f"more than {_DEEPEST} levels or {_LONGEST} parts in one result")
        if isinstance(content, _PLAIN):
            return content
        kind = content.get("is") if isinstance(content, dict) else None
        if kind == "array":
            return _array(content)
        if kind == "GuestItem":
            name, hidden = content["kind"], base64.b64decode(content["data"], validate=True)
            if not isinstance(name, str) or not name.isidentifier():
                raise ItemError("a class without a name")
            self._limit_plain(content["value"], depth)
            return GuestItem(name[:64], content["value"], hidden)
        inner = content["of"] if kind is not None else None
        if kind in {"list", "tuple", "AeroNavigation"} and isinstance(inner, list):
            found = [self.read(one, depth + 1) for one in inner]
            if kind == "AeroNavigation":
                how = waypoints.SchedulingType(content["scheduling"])
                return AeroNavigation(data=found, scheduling_type=how)
            return found if kind == "list" else tuple(found)
        if isinstance(inner, dict) and (kind == "dict" or kind in _CLASSES):
            fields = {key: self.read(one, depth + 1) for key, one in inner.items()}
            return fields if kind == "dict" else _built(_CLASSES[kind], fields)
        raise ItemError(f"there is no class {str(kind)[:40]!r} that a guest may send")

    def _limit_plain(self, value: Any, depth: int) -> None:  # noqa: ANN401 - JSON
        self._parts += 1
        if depth > 2 * _DEEPEST or self._parts > _LONGEST:
            raise ItemError("an object too large to be shown")
        if isinstance(value, dict | list):
            for one in value.values() if isinstance(value, dict) else value:
                self._limit_plain(one, depth + 1)


def _array(content: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    kind = np.dtype(str(content["type"])[:8])
    if kind.kind not in _KINDS:
        raise ItemError(f"an array of {kind}")
    shape = [int(one) for one in content["shape"]]
    whole = base64.b64decode(content["data"], validate=True)
    if len(shape) > _DEEPEST or any(one < 0 for one in shape):
        raise ItemError("an array of an impossible shape")
    return np.frombuffer(whole, kind).reshape(shape)


def _built(kind: type, fields: dict[str, Any]) -> Any:  # noqa: ANN401 - an instance
    hints = _hints(kind)
    for name, value in fields.items():
        if name not in hints or not _conforms(value, hints[name]):
            raise ItemError(f"{kind.__name__}.{name[:40]} is of a wrong type")
    return kind(**fields)


def _names(kind: type) -> tuple[str, ...]:
    fields: tuple[str, ...] | None = getattr(kind, "_fields", None)
    return fields or tuple(one.name for one in dataclasses.fields(kind))


@lru_cache(maxsize=64)
def _hints(kind: type) -> dict[str, Any]:
    found = typing.get_type_hints(kind)
    return {name: found[name] for name in _names(kind)}


def _conforms(value: object, hint: Any) -> bool:  # noqa: ANN401 - an annotation
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Union or isinstance(hint, types.UnionType):
        return any(_conforms(value, one) for one in arguments)
    if origin is tuple:
        return isinstance(value, tuple) and _conform(value, arguments)
    if origin is dict:
        return isinstance(value, dict) and _conform(tuple(value.values()), (arguments[1], ...))
    if hint in {int, float} and isinstance(value, int):
        # JSON does not tell 1 from 1.0.
        most = 53 if hint is float else 63
        return not isinstance(value, bool) and abs(value) < 1 << most
    return isinstance(value, origin or hint)


def _conform(values: tuple[object, ...], hints: tuple[Any, ...]) -> bool:
    if hints[-1] is Ellipsis:
        return all(_conforms(one, hints[0]) for one in values)
    return len(values) == len(hints) and all(map(_conforms, values, hints))
