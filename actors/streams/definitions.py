"""Definitions of classes that readers cannot import, such as those of the application's own file.

Pickle refers to a class by its module, and the module `__main__` differs in every process. The
run sends the definitions of its application's classes to all its processes beforehand
(`define`), so that a message only refers to them by name. A class defined later, such as one
created in flight, is sent with each message that needs it. In both cases a process builds a class
once, and `isinstance` holds in every process.
"""

from __future__ import annotations

import io
import pickle
import threading
import uuid
from collections.abc import Callable, Mapping
from typing import Any

from ray import cloudpickle

from aerodaas.actors.streams.plain import importable

__all__ = ["define", "name_of", "named", "pickled", "pickled_class", "register"]

_lock = threading.RLock()
_unbuilt: dict[str, bytes] = {}
"""Pickled definitions that are not built yet, by name."""
_built: dict[str, Any] = {}
"""Built definitions by name."""
_references: dict[int, tuple[Any, tuple[Any, ...]]] = {}
"""Pickle reductions by the id of their class, with the class itself, to keep it alive."""


def define(definitions: Mapping[str, bytes]) -> None:
    """Store definitions by name, pickled by `pickled_class`; each is built when needed."""
    with _lock:
        new = {name: data for name, data in definitions.items() if name not in _built}
        _unbuilt.update(new)


def register(name: str, definition: type) -> None:
    """Register a class of this process as `name`, in the process that defines it."""
    with _lock:
        _built[name] = definition
        _references[id(definition)] = definition, (named, (name,))


def name_of(definition: object) -> str | None:
    """Name of a class registered in this process; None for any other."""
    with _lock:
        _, (build, arguments) = _references.get(id(definition), (None, (None, ())))
        return arguments[0] if build is named else None


def named(name: str) -> Any:  # noqa: ANN401 - a class
    """Definition of this name; raises ImportError if it is not defined in this run."""
    with _lock:
        if name not in _built:
            if name not in _unbuilt:
                raise ImportError(f"{name.partition('/')[2]} is not defined in this run")
            register(name, pickle.loads(_unbuilt[name]))  # noqa: S301 - the application's own
            del _unbuilt[name]
        return _built[name]


def _carried(name: str, data: bytes) -> Any:  # noqa: ANN401 - a class
    """Definition sent with a message."""
    define({name: data})
    return named(name)


def pickled_class(definition: object) -> bytes:
    """Pickle a class, function or object by value; raises the exceptions of pickling."""
    data: bytes = cloudpickle.dumps(definition, protocol=5)  # pyright: ignore[reportPrivateImportUsage]
    return data


def pickled(item: object, buffers: Callable[[pickle.PickleBuffer], Any]) -> bytes:
    """Pickle an item whose classes may be the application's; raises the errors of pickling."""
    file = io.BytesIO()
    pickler: Any = _Pickler
    pickler(file, protocol=5, buffer_callback=buffers).dump(item)
    return file.getvalue()


class _Pickler(cloudpickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:  # noqa: ANN401 - pickle's
        if isinstance(obj, type) and not importable(obj):
            return _reference(obj)
        known: Any = super()
        return known.reducer_override(obj)


def _reference(definition: type) -> tuple[Any, ...]:
    with _lock:
        known = _references.get(id(definition))
        if known is None and not _find(definition):
            data = pickled_class(definition)
            name = f"{uuid.uuid4().hex}/{definition.__qualname__}"
            _built[name] = definition
            _references[id(definition)] = definition, (_carried, (name, data))
        return _references[id(definition)][1]


def _find(definition: type) -> bool:
    """Return whether a class received otherwise, such as in a Ray call, has a name in the run."""
    for name in [one for one in _unbuilt if one.partition("/")[2] == definition.__qualname__]:
        # Cloudpickle tracks the classes that it has built and returns the same one.
        if named(name) is definition:
            return True
    return id(definition) in _references
