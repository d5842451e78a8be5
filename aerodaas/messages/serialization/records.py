"""Records: decorators that make dataclasses equal by value, arrays and all, and quick to pickle."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import lru_cache
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

__all__ = [
    "UNSENT",
    "fast_pickle",
    "shared_pickle",
    "unsent_fields",
    "valued",
]

C = TypeVar("C", bound=type[Any])
UNSENT: Mapping[str, bool] = {"exclude": True}
"""Metadata of a dataclass' field that is recorded nowhere, and never sent to others."""
_PLAIN = frozenset({bool, float, int, str})
"""What most fields are; all else is asked what it is, which takes several times as long."""
_MOST_SHARED = 4096
"""Records that came last and are kept to be found again."""
_HASHED = 16
"""Elements of an array that its hash uses: enough to tell most apart, few enough to be quick."""


_JSON = {
    "extra": "forbid",
    "ser_json_bytes": "base64",
    "val_json_bytes": "base64",
    "ser_json_inf_nan": "null",
}
"""How pydantic writes a record's fields as JSON, and reads them."""


@lru_cache(maxsize=1024)
def unsent_fields(cls: type) -> frozenset[str]:
    """Names of a class' fields that are `UNSENT`; none of what is no dataclass."""
    fields = dataclasses.fields(cls) if dataclasses.is_dataclass(cls) else ()
    return frozenset(one.name for one in fields if one.metadata.get("exclude"))


def valued(cls: C) -> C:
    """Compare and hash a dataclass by the contents of its fields.

    The methods that `dataclass` writes raise on arrays, and on hashing dictionaries and lists.
    Arrays are equal by shape and numbers, whatever their number type; NaN equals NaN, so that a
    copy equals its original.
    """
    values = _values_of(cls)

    def equal(self: Any, other: object) -> Any:  # noqa: ANN401 - an instance of `cls`
        if self is other:
            return True
        if type(other) is not type(self):
            return NotImplemented
        return all(map(_same, values(self), values(other)))

    def digest(self: Any) -> int:  # noqa: ANN401 - an instance of `cls`
        return hash((type(self), _key(values(self))))

    cls.__eq__ = equal  # type: ignore[assignment]
    cls.__hash__ = digest  # type: ignore[assignment]
    return cls


def fast_pickle(cls: C) -> C:
    """Pickle a dataclass by its constructor's arguments, and compare it as `valued` does.

    The state methods that `dataclass(slots=True)` writes look every field up anew, at several
    times the cost, and these records are pickled on every hop of every frame.
    """
    values = _values_of(cls)

    def reduce(self: Any) -> tuple[Any, tuple[Any, ...]]:  # noqa: ANN401 - an instance of `cls`
        if type(self) is not cls:
            return _rebuilt, (type(self), _state(self))
        return cls, values(self)

    cls.__reduce__ = reduce  # type: ignore[assignment]
    cls.__pydantic_config__ = _JSON
    return valued(cls)


def shared_pickle(cls: C) -> C:
    """Pickle as `fast_pickle` does, and find an equal record instead of building another.

    For what is immutable, throughout, and comes again and again, such as the waypoints in each
    status of a mission. Its values are hashed as they are.
    """
    fast_pickle(cls)
    values = _values_of(cls)
    otherwise: Any = cls.__reduce__

    def reduce(self: Any) -> Any:  # noqa: ANN401 - an instance of `cls`
        return (_found, (cls, *values(self))) if type(self) is cls else otherwise(self)

    cls.__reduce__ = reduce  # type: ignore[assignment]
    return cls


@lru_cache(maxsize=_MOST_SHARED, typed=True)
def _found(cls: type[Any], *values: object) -> object:
    return cls(*values)


def _values_of(cls: type[Any]) -> Callable[[Any], tuple[Any, ...]]:
    names = [field.name for field in dataclasses.fields(cls)]
    if len(names) > 1:
        return attrgetter(*names)
    only = names[0]
    return lambda record: (getattr(record, only),)


def _same(one: object, other: object) -> bool:
    if one is other or (type(one) in _PLAIN and type(one) is type(other) and one == other):
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return _same_arrays(one, other)
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        like = isinstance(one, tuple) == isinstance(other, tuple) and len(one) == len(other)
        return like and all(map(_same, one, other))
    return bool(one == other) or (_is_nan(one) and _is_nan(other))


def _same_arrays(one: object, other: object) -> bool:
    if not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray)):
        return False
    if one.dtype.kind == "f" or other.dtype.kind == "f":
        return np.array_equal(one, other, equal_nan=True)
    return np.array_equal(one, other)


def _key(value: object) -> object:
    """Something that can be hashed and is the same for values that are the same."""
    if isinstance(value, np.ndarray):
        # Equal arrays may differ in number type; what is no number is told by the shape alone.
        head = value.ravel()[:_HASHED] if value.dtype.kind in "biuf" else ()
        return value.shape, tuple(_key(float(one)) for one in head)
    if isinstance(value, Mapping):
        return frozenset((key, _key(one)) for key, one in value.items())
    if isinstance(value, tuple | list):
        return tuple(_key(one) for one in value)
    if _is_nan(value):
        return "nan"
    return value if _can_be_hashed(value) else type(value).__name__


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and value != value  # noqa: PLR0124 - what NaN is


def _can_be_hashed(value: object) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True


def _state(record: object) -> dict[str, Any]:
    """All that an object of a derived class holds: its constructor may be any."""
    slots = (getattr(one, "__slots__", ()) for one in type(record).__mro__)
    names = [name for some in slots for name in ((some,) if isinstance(some, str) else some)]
    held = {name: getattr(record, name) for name in names if hasattr(record, name)}
    return {**held, **getattr(record, "__dict__", {})}


def _rebuilt(cls: type, state: dict[str, Any]) -> object:
    record: object = object.__new__(cls)
    for name, value in state.items():
        object.__setattr__(record, name, value)  # a frozen one refuses its own
    return record
