"""Items as plain values, which `marshal` writes and reads faster than pickle does objects.

Between two frames the processor's caches hold other things, so what counts is how much code and
data a message touches, and pickle looks every class up by an import. A plain value is None, a
number, a string or bytes, or a tuple of a tag and plain values: the tag is a number for NumPy's
arrays, and the name of the class for anything else. Arrays of more than
`LONGEST_INLINE_ARRAY` bytes stay outside, in buffers.

What this cannot hold goes by pickle: classes with ways of their own of being pickled, or such as a
reader cannot import, long lists, and what contains itself. What stands in two places of an item
arrives as two equal things.
"""

from __future__ import annotations

import copyreg
import enum
import importlib
import sys
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from ray import cloudpickle

from aerodaas.messages.records import record_of

__all__ = ["LONGEST_INLINE_ARRAY", "NotPlainError", "Plain", "flatten", "importable", "rebuild"]

Plain: TypeAlias = bool | int | float | str | bytes | tuple[Any, ...] | None
LONGEST_INLINE_ARRAY = 256
"""Bytes of an array up to which it is among the plain values: apart, it would cost several times
as much."""
_ATOMS = frozenset({type(None), bool, int, float, str, bytes})
_APART, _INLINE = range(2)
_NUMBERS = "biufc"
"""Kinds of NumPy's numbers; arrays of anything else go by pickle."""
_MOST_PARTS = 256
"""Parts of an object beyond which pickle, which is written in C, is faster."""


class NotPlainError(Exception):
    """An item is not made of plain values."""


class _Kind(NamedTuple):
    """How the objects of a class are taken apart and made anew."""

    name: str
    parts: Callable[[Any], Sequence[Any]]
    make: Callable[[list[Any]], Any]


def flatten(value: Any, arrays: list[NDArray[Any]]) -> Plain:  # noqa: ANN401 - any item
    """Return `value` as a plain value; its large arrays, made contiguous, are added to `arrays`.

    Raises NotPlainError, or RecursionError for what contains itself.
    """
    cls = type(value)
    if cls in _ATOMS:
        atom: Plain = value
        return atom
    if cls is np.ndarray:
        return _flat_array(value, arrays)
    kind = _kinds.get(cls) or _learn(cls)
    parts = kind.parts(value)
    if len(parts) > _MOST_PARTS:
        raise NotPlainError
    return kind.name, *[one if type(one) in _ATOMS else flatten(one, arrays) for one in parts]


def rebuild(plain: Plain, buffers: Sequence[memoryview]) -> Any:  # noqa: ANN401 - any item
    """Return the item that `flatten` made `plain` of; its arrays are read-only.

    Raises whatever prevents it, such as ImportError for a class that is not found here.
    """
    if type(plain) is not tuple:
        return plain
    tag = plain[0]
    if type(tag) is not str:
        return _array(plain, buffers)
    make = (_named.get(tag) or _find(tag)).make
    return make([rebuild(one, buffers) if type(one) is tuple else one for one in plain[1:]])


def importable(definition: type) -> bool:
    """Return whether a reader finds a class by the names of its module and its own."""
    module = definition.__module__
    if module == "builtins":
        return True
    try:
        found = attrgetter(definition.__qualname__)(sys.modules[module])
    except (AttributeError, KeyError):
        return False
    by_value = module == "__main__" or module in cloudpickle.list_registry_pickle_by_value()
    return found is definition and not by_value


def _flat_array(array: NDArray[Any], arrays: list[NDArray[Any]]) -> Plain:
    dtype = array.dtype
    if dtype.kind not in _NUMBERS:
        raise NotPlainError
    if array.nbytes <= LONGEST_INLINE_ARRAY:
        return _INLINE, dtype.str, array.shape, array.tobytes()
    arrays.append(np.ascontiguousarray(array))
    return _APART, dtype.str, array.shape, len(arrays) - 1


def _array(plain: tuple[Any, ...], buffers: Sequence[memoryview]) -> NDArray[Any]:
    tag, dtype, shape, content = plain
    if tag == _INLINE:
        inline: NDArray[Any] = np.ndarray(shape, dtype, content)
        return inline
    # Not np.ndarray, which would keep the owner of all the memory instead of this view of it.
    apart: NDArray[Any] = np.frombuffer(buffers[content], dtype).reshape(shape)
    return apart


def _learn(cls: type[Any]) -> _Kind:
    """Return how to treat a class that is met for the first time. Raises NotPlainError."""
    kind = None if cls in _pickled else _kind(cls)
    if kind is None or not importable(cls):
        _pickled.add(cls)
        raise NotPlainError
    _kinds[cls] = _named[kind.name] = kind
    return kind


def _find(name: str) -> _Kind:
    """Return how to make objects of a class that has not been met here."""
    module, _, qualified = name.partition(":")
    cls = attrgetter(qualified)(importlib.import_module(module))
    kind = _kind(cls) if isinstance(cls, type) else None
    if kind is None:
        raise TypeError(f"{name} is made otherwise here")
    _kinds[cls] = _named[name] = kind
    return kind


def _kind(cls: type[Any]) -> _Kind | None:
    """How a class is treated; None if its objects go by pickle."""
    name = f"{cls.__module__}:{cls.__qualname__}"
    record = record_of(cls)
    if record is not None:
        return _Kind(name, record.values, record.make)
    if issubclass(cls, enum.Enum):
        return _Kind(name, lambda member: (member.value,), lambda parts: cls(*parts))
    if issubclass(cls, np.generic):
        plain = np.dtype(cls).kind in _NUMBERS and type(cls(0).item()) in _ATOMS
        return _Kind(name, lambda one: (one.item(),), lambda parts: cls(*parts)) if plain else None
    return _object_kind(name, cls) if _is_pickled_plainly(cls) else None


def _object_kind(name: str, cls: type[Any]) -> _Kind | None:
    """Of a named tuple, or a class whose objects have all that they hold in `__dict__`."""
    if issubclass(cls, tuple):
        make = getattr(cls, "_make", None)
        return None if make is None else _Kind(name, _same, make)
    if cls.__new__ is not _NEW or not cls.__dictoffset__ or _slots(cls):
        return None
    return _Kind(name, lambda one: _pairs(one.__dict__), _filler(cls))


def _is_pickled_plainly(cls: type[Any]) -> bool:
    """Whether a class leaves it to pickle how its objects are pickled."""
    own = (getattr(cls, name, None) is not getattr(object, name, None) for name in _PICKLING)
    return cls not in copyreg.dispatch_table and not any(own)


def _slots(cls: type[Any]) -> bool:
    return any(getattr(one, "__slots__", ()) for one in cls.__mro__)


def _filler(cls: type[Any]) -> Callable[[list[Any]], Any]:
    """What makes an object of the names and values of its attributes."""
    new = object.__new__

    def make(parts: list[Any]) -> Any:  # noqa: ANN401 - an instance of `cls`
        made = new(cls)
        made.__dict__.update(_mapping(parts))
        return made

    return make


def _same(value: Any) -> Any:  # noqa: ANN401 - a sequence
    return value


def _pairs(mapping: dict[Any, Any]) -> list[Any]:
    return [part for pair in mapping.items() for part in pair]


def _mapping(parts: list[Any]) -> dict[Any, Any]:
    return dict(zip(parts[::2], parts[1::2], strict=True))


_NEW: Any = object.__new__
_PICKLING = ("__reduce_ex__", "__reduce__", "__getstate__", "__setstate__", "__getnewargs_ex__")
"""Methods with which a class says how it is pickled. A named tuple has `__getnewargs__`."""
_kinds: dict[type[Any], _Kind] = {
    tuple: _Kind("tuple", _same, tuple),
    list: _Kind("list", _same, _same),
    dict: _Kind("dict", _pairs, _mapping),
}
_pickled: set[type[Any]] = set()
"""Classes whose objects go by pickle, as far as they have been met."""
_named = {kind.name: kind for kind in _kinds.values()}
