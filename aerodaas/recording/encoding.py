"""Topics of a recording, and the JSON of objects that have no class of ours."""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import is_dataclass
from enum import Enum, Flag
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from foxglove import Schema

from aerodaas.identifiers import INTERNAL, is_internal
from aerodaas.messages.serialization.records import unsent_fields

__all__ = ["Entry", "plain", "stream_of", "topic"]

_DEEPEST = 12
_LONGEST_ARRAY = 4096
_TAKEN = frozenset({"fence", "setpoints", "state", "status"})
"""Last parts of a robot's topics that are reserved for this project."""
_OWN = "own."
_LONGEST_TEXT = 1000
_DEEPEST_OBJECT = 4
_FORBIDDEN = re.compile(r"[^A-Za-z0-9_/\-]+")


class Entry(NamedTuple):
    """One encoded message for one channel."""

    topic: str
    schema: Schema
    """Schema of the channel; its encoding is `protobuf` or `jsonschema`."""
    data: bytes
    stamp: int | None = None
    """Mission time of the described measurement, if it differs from the message header's."""


@lru_cache(maxsize=4096)
def topic(stream: str, kind: str) -> str:
    """Topic of one kind of data of a stream, such as `/robot/camera/image`.

    Dots and blanks become `_`; a stream already named after the kind does not repeat it. The
    marker of internal streams is removed (`/robot/state`), so a robot's sensor or analysis with
    such a name is recorded as `/robot/own.state`.

    Args:
        stream: Name of the stream.
        kind: Kind of data.
    """
    plain_name = stream.replace(INTERNAL, "") if is_internal(stream) else stream
    name = "/" + _FORBIDDEN.sub("_", plain_name).strip("/")
    owner, _, last = name.rpartition("/")
    if owner and last in _TAKEN and not is_internal(stream):
        name = f"{owner}/{_OWN}{last}"
    return name if name.rsplit("/", 1)[-1] == kind else f"{name}/{kind}"


def stream_of(name: str) -> str:
    """Stream of a sensor or analysis from its topic without the kind; inverse of `topic`."""
    owner, slash, last = name.strip("/").rpartition("/")
    return f"{owner}{slash}{last.removeprefix(_OWN)}"


def plain(value: object, depth: int = 0) -> Any:  # noqa: ANN401 - any JSON value
    """Reduce any object to JSON's types; never raises, even if a method of the object does.

    Non-finite numbers become None, large arrays their shape and type, enumeration members their
    name, objects with fields a dictionary of these fields, and other objects their `str`.

    Args:
        value: Any object.
        depth: Levels of containers around it.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    if depth < _DEEPEST:
        # An object of the application may raise any exception from its own methods.
        with suppress(Exception):
            return _plain_container(value, depth + 1)
    return f"<{type(value).__name__}>"


def _plain_container(value: object, depth: int) -> Any:  # noqa: ANN401 - any JSON value
    if isinstance(value, np.ndarray):
        whole = value.size <= _LONGEST_ARRAY and value.dtype.kind in "biuf"
        shape = {"shape": list(value.shape), "dtype": str(value.dtype)}
        return plain(value.tolist(), depth) if whole else shape
    names = getattr(value, "_fields", None)
    if isinstance(value, tuple) and isinstance(names, tuple):
        value = dict(zip(names, value, strict=True))
    if isinstance(value, Mapping):
        return {str(key): plain(item, depth) for key, item in value.items()}
    if isinstance(value, list | tuple | AbstractSet):
        return [plain(item, depth) for item in value]
    fields = {} if isinstance(value, type | Enum) else _fields(value)
    # Objects that refer to each other are cut off at a smaller depth than nested lists.
    if fields and depth <= _DEEPEST_OBJECT:
        return {name: plain(item, depth) for name, item in fields.items()}
    return _words(value)


def _fields(value: Any) -> dict[str, Any]:  # noqa: ANN401 - any object
    """Data fields of an object by name; empty for objects of the standard library."""
    dump = getattr(value, "model_dump", None) or getattr(value, "get_data", None)
    if callable(dump):
        data = dump()
        return data if isinstance(data, dict) else {"data": data}
    kind: Any = type(value)
    names, further = _declared(kind)
    if further:
        held = getattr(value, "__dict__", {})
        names = (*names, *(name for name in held if not name.startswith("__")))
    return {name: getattr(value, name) for name in names if hasattr(value, name)}


@lru_cache(maxsize=1024)
def _declared(kind: type) -> tuple[tuple[str, ...], bool]:
    """Fields and slots of a class, and whether its objects' further attributes are data, too."""
    unsent = unsent_fields(kind)
    names = [field.name for field in dataclasses.fields(kind)] if is_dataclass(kind) else []
    own = kind.__module__.partition(".")[0] not in sys.stdlib_module_names
    if own:
        slots = (getattr(one, "__slots__", ()) for one in kind.__mro__)
        names += [name for some in slots for name in ((some,) if isinstance(some, str) else some)]
    return tuple(name for name in dict.fromkeys(names) if name not in unsent), own


def _words(value: object) -> str:
    if isinstance(value, Enum) and value.name is not None:
        return value.name
    # On Python 3.10 several flags together have no name.
    if isinstance(value, Flag):
        flags = [str(one.name) for one in type(value) if one.value and one in value]
        return "|".join(flags) or str(value)
    if isinstance(value, type) or _wordless(type(value)):
        return f"<{getattr(value, '__qualname__', type(value).__name__)}>"
    text = str(value)
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}…"


def _wordless(kind: type) -> bool:
    """Whether the class has neither `__str__` nor `__repr__` of its own."""
    words: tuple[object, object] = kind.__str__, kind.__repr__
    return words == (object.__str__, object.__repr__)
