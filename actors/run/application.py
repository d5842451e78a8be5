"""Definitions of the application's own files, as sent to every process of its run.

The session carries them: modules as source text, and the classes of files that run as
`__main__`, which other processes cannot import, as pickles. An actor gets its session first, so
that later messages find their classes defined.
"""

from __future__ import annotations

import contextlib
import inspect
import sys
import types
import uuid
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from aerodaas.actors.run.sources import Source, imported_names, own_sources, serve
from aerodaas.actors.streams import definitions as _definitions
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.plugins import main_name
from aerodaas.dataflow.graph import Graph

__all__ = ["Application", "capture"]

_LARGEST = 1 << 20
"""Bytes of a class beyond which it is sent only with the items that need it."""


@dataclass(frozen=True)
class Application:
    """Modules and classes of an application; unpickling it makes them available."""

    sources: Mapping[str, Source] = field(default_factory=dict)
    """Modules by name."""
    definitions: Mapping[str, bytes] = field(default_factory=dict)
    """Pickled classes by `id/qualified name`."""
    plugins: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Names of definitions by attribute, by module name of the application's own file."""

    def and_later(self, later: Application) -> Application:
        """Union of this and the `later` definitions, which have precedence."""
        plugins = {**self.plugins}
        for name, attributes in later.plugins.items():
            plugins[name] = {**plugins.get(name, {}), **attributes}
        return Application(
            {**self.sources, **later.sources},
            {**self.definitions, **later.definitions},
            plugins,
        )

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """Pickle it so that unpickling makes its modules and classes available."""
        return _arrived, (dict(self.sources), dict(self.definitions), dict(self.plugins))


def _arrived(
    sources: dict[str, Source],
    definitions: dict[str, bytes],
    plugins: dict[str, dict[str, str]],
) -> Application:
    serve(sources)
    _definitions.define(definitions)
    for name, attributes in plugins.items():
        if name not in sys.modules:
            module = types.ModuleType(name, "The application's own file, by what it defines.")
            vars(module)["__getattr__"] = partial(_defined, name, attributes)
            sys.modules[name] = module
    return Application(sources, definitions, plugins)


def _defined(module: str, attributes: dict[str, str], name: str) -> Any:  # noqa: ANN401 - a class
    if name not in attributes:
        raise AttributeError(f"{module} defines no class {name!r} that could be sent")
    return _definitions.named(attributes[name])


def capture(graph: Graph, config: EnvironmentConfig, *plugins: object) -> Application:
    """Collect the definitions of the application and its guests, in their own process.

    `plugins` are instances of its classes outside the graph, such as schedulers.
    """
    used = [*_used(graph), *plugins]
    files = _main_files(used)
    named = [name.partition(":") for name in _plugin_names(config) if ":" in name]
    definitions: dict[str, bytes] = {}
    attributes: dict[str, dict[str, str]] = {}
    for number, namespace in enumerate(files):
        name = main_name(namespace)
        wanted = {attribute for module, _, attribute in named if module == name}
        prefix = f"{uuid.uuid4().hex[:12]}-{number}"
        defined = _define(prefix, [*_classes(namespace), *_functions(namespace, wanted)])
        definitions |= defined
        if name is not None:
            attributes.setdefault(name, {key.partition("/")[2]: key for key in defined})
    local = [one for one in _mentioned(used) if "<locals>" in one.__qualname__]
    definitions |= _define(f"{uuid.uuid4().hex[:12]}-local", local)
    seeds: list[tuple[str, list[str]]] = [(module, []) for module, _, _ in named]
    seeds += [(one.__module__, []) for one in _mentioned(used)]
    seeds += [(one.__module__, []) for one in used if isinstance(one, types.FunctionType)]
    for namespace in files:
        seeds += _imports_of(namespace)
    return Application(own_sources(seeds), definitions, attributes)


def _define(prefix: str, found: Iterable[Any]) -> dict[str, bytes]:
    """Pickle classes one by one, leaving out those that cannot be pickled."""
    definitions: dict[str, bytes] = {}
    for one in found:
        # A class that cannot be pickled is reported where it is used.
        with contextlib.suppress(Exception):
            data = _definitions.pickled_class(one)
            # A class keeps the name that running actors already use in messages.
            name = _definitions.name_of(one) or f"{prefix}/{one.__qualname__}"
            if len(data) <= _LARGEST and name not in definitions:
                definitions[name] = data
                if isinstance(one, type):
                    _definitions.register(name, one)
    return definitions


def _used(graph: Graph) -> list[object]:
    """Objects of the graph whose classes the user may have written."""
    used: list[object] = []
    for node in graph.nodes.values():
        used += [node.work, node.item, *(one.when for one in node.triggers if one.when)]
    for edge in graph.navigation:
        used += list(edge.navigation)
    return used


def _main_files(used: Iterable[object]) -> list[dict[str, Any]]:
    """Namespaces of files that run as `__main__`: the application's and its guests'."""
    files: dict[int, dict[str, Any]] = {}
    main = sys.modules.get("__main__")
    if main is not None:
        files[id(vars(main))] = vars(main)
    for one in used:
        for function in _functions_of(one):
            namespace = function.__globals__
            if namespace.get("__name__") == "__main__":
                files.setdefault(id(namespace), namespace)
    return list(files.values())


def _functions_of(one: object) -> Iterator[types.FunctionType]:
    if isinstance(one, types.FunctionType):
        yield one
    elif inspect.ismethod(one):
        yield from _functions_of(one.__func__)
    else:
        for kind in (one if isinstance(one, type) else type(one)).__mro__:
            for value in vars(kind).values():
                function = getattr(value, "__func__", value)  # of static and class methods
                if isinstance(function, types.FunctionType):
                    yield function


def _classes(namespace: dict[str, Any]) -> Iterator[type]:
    for value in list(namespace.values()):
        if isinstance(value, type) and value.__module__ == "__main__":
            yield from _with_nested(value)


def _with_nested(outer: type) -> Iterator[type]:
    yield outer
    for value in list(vars(outer).values()):
        nested = isinstance(value, type) and value.__module__ == outer.__module__
        if nested and value.__qualname__ == f"{outer.__qualname__}.{value.__name__}":
            yield from _with_nested(value)


def _functions(namespace: dict[str, Any], wanted: set[str]) -> Iterator[Any]:
    for name in wanted & namespace.keys():
        if isinstance(namespace[name], types.FunctionType):
            yield namespace[name]


def _mentioned(used: Iterable[object]) -> list[type]:
    """Classes of the objects used, their bases, and the type arguments of these bases."""
    found: dict[type, None] = {}
    waiting: list[object] = [one if isinstance(one, type) else type(one) for one in used]
    while waiting:
        one = waiting.pop()
        if isinstance(one, type) and one not in found:
            found[one] = None
            waiting += one.__mro__
            waiting += [a for base in getattr(one, "__orig_bases__", ()) for a in _arguments(base)]
    return list(found)


def _arguments(base: object) -> Iterator[object]:
    for argument in getattr(base, "__args__", ()):
        yield argument
        yield from _arguments(argument)


def _plugin_names(config: EnvironmentConfig) -> list[str]:
    sensors = [*config.sensors, *(one for robot in config.robots for one in robot.sensors)]
    names = [*(robot.driver for robot in config.robots), *(one.driver for one in sensors)]
    return [name for name in names if name]


def _imports_of(namespace: dict[str, Any]) -> list[tuple[str, list[str]]]:
    """Modules that a file that runs as `__main__` imports, with its folder."""
    try:
        file = Path(namespace["__file__"]).resolve()
        text = file.read_bytes()
    except (KeyError, TypeError, OSError):
        return []
    package = namespace.get("__package__") or ""
    return [(name, [str(file.parent)]) for name in imported_names(text, package)]
