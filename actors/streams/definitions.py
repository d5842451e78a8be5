"""Classes that no reader can import, such as those of the application's own file, by name.

Pickle names a class by its module, and the module `__main__` is another one in every process. The
run hands all its processes the definitions of its application's classes beforehand (`define`), so
that a message only names them. A class unknown then, such as one made in flight,
travels with each message that needs it. Either way a process builds a class once, and
`isinstance` holds wherever an item goes.
"""

from __future__ import annotations

import io
import pickle
import sys
import threading
import uuid
from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any

from ray import cloudpickle

__all__ = ["define", "name_of", "named", "pickled", "pickled_class", "register"]

_lock = threading.RLock()
_unbuilt: dict[str, bytes] = {}
"""Definitions that were not needed yet, by name."""
_built: dict[str, Any] = {}
"""Definitions by name."""
_references: dict[int, tuple[Any, tuple[Any, ...]]] = {}
"""How a class is put into a message, by its id; the class itself comes along, to keep it."""


def define(definitions: Mapping[str, bytes]) -> None:
    """Take definitions by name, as `pickled_class` made them; each is built when it is needed."""
    with _lock:
        new = {name: data for name, data in definitions.items() if name not in _built}
        _unbuilt.update(new)


def register(name: str, definition: type) -> None:
    """Call a class of this process `name`; in the process that it comes from."""
    with _lock:
        _built[name] = definition
        _references[id(definition)] = definition, (named, (name,))


def name_of(definition: object) -> str | None:
    """The name of a class that was registered in this process; None for any other."""
    with _lock:
        _, (build, arguments) = _references.get(id(definition), (None, (None, ())))
        return arguments[0] if build is named else None


def named(name: str) -> Any:  # noqa: ANN401 - a class
    """The definition of this name; raises ImportError, with the reason, if it cannot be built."""
    with _lock:
        if name not in _built:
            if name not in _unbuilt:
                raise ImportError(f"{name.partition('/')[2]} is not defined in this run")
            register(name, pickle.loads(_unbuilt[name]))  # noqa: S301 - the application's own
            del _unbuilt[name]
        return _built[name]


def _carried(name: str, data: bytes) -> Any:  # noqa: ANN401 - a class
    """The definition that came with a message."""
    define({name: data})
    return named(name)


def pickled_class(definition: object) -> bytes:
    """A pickled class or function with everything that it needs; raises pickling's errors."""
    data: bytes = cloudpickle.dumps(definition, protocol=5)  # pyright: ignore[reportPrivateImportUsage]
    return data


def pickled(item: object, buffers: Callable[[pickle.PickleBuffer], Any]) -> bytes:
    """Pickle an item whose classes may be the application's; raises pickling's errors."""
    file = io.BytesIO()
    pickler: Any = _Pickler
    pickler(file, protocol=5, buffer_callback=buffers).dump(item)
    return file.getvalue()


class _Pickler(cloudpickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:  # noqa: ANN401 - pickle's
        if isinstance(obj, type) and not _importable(obj):
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
    """Whether a class that came here by another path is one that the run has a name for."""
    for name in [one for one in _unbuilt if one.partition("/")[2] == definition.__qualname__]:
        # Cloudpickle keeps track of the classes that it has built: the same one comes back.
        if named(name) is definition:
            return True
    return id(definition) in _references


def _importable(definition: type) -> bool:
    module = definition.__module__
    if module == "builtins":
        return True
    try:
        found = attrgetter(definition.__qualname__)(sys.modules[module])
    except (AttributeError, KeyError):
        return False
    return found is definition and module != "__main__"
