"""Definitions of the application's own files, as sent to every process of its run.

Modules travel with Ray's job, by its `runtime_env`. The session carries as pickles the classes of
files that other processes cannot import: those that run as `__main__`, and modules that the job
lacks, because they were imported or changed after it was joined. An actor gets its session first,
so that later messages find their classes defined.
"""

from __future__ import annotations

import contextlib
import inspect
import sys
import types
import uuid
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from ray import cloudpickle

from aerodaas.actors.cluster import ray_cluster
from aerodaas.actors.run.own_modules import imported_names, is_installed, own_modules
from aerodaas.actors.streams import definitions as _definitions
from aerodaas.config.model import EnvironmentConfig, RuntimeEnvConfig
from aerodaas.config.plugins import main_name
from aerodaas.dataflow.graph import Graph

__all__ = ["Application", "capture", "main_modules"]

_LARGEST = 1 << 20
"""Bytes of a class beyond which it is sent only with the items that need it."""


@dataclass(frozen=True)
class Application:
    """Modules and classes of an application; unpickling it makes them available."""

    definitions: Mapping[str, bytes] = field(default_factory=dict)
    """Pickled classes by `id/qualified name`."""
    plugins: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Names of definitions by attribute, by module name of the application's own file."""
    files: tuple[Path, ...] = ()
    """Files and folders of the modules that Ray's job brings along; they stay here."""

    def and_later(self, later: Application) -> Application:
        """Union of this and the `later` definitions, which have precedence."""
        plugins = {**self.plugins}
        for name, attributes in later.plugins.items():
            plugins[name] = {**plugins.get(name, {}), **attributes}
        return Application(
            {**self.definitions, **later.definitions},
            plugins,
            tuple(dict.fromkeys((*self.files, *later.files))),
        )

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """Pickle it so that unpickling makes its modules and classes available."""
        return _arrived, (dict(self.definitions), dict(self.plugins))


def _arrived(definitions: dict[str, bytes], plugins: dict[str, dict[str, str]]) -> Application:
    _definitions.define(definitions)
    for name, attributes in plugins.items():
        if name not in sys.modules:
            module = types.ModuleType(name, "The application's own file, by what it defines.")
            vars(module)["__getattr__"] = partial(_defined, name, attributes)
            sys.modules[name] = module
    return Application(definitions, plugins)


def _defined(module: str, attributes: dict[str, str], name: str) -> Any:  # noqa: ANN401 - a class
    if name not in attributes:
        raise AttributeError(f"{module} defines no class {name!r} that could be sent")
    return _definitions.named(attributes[name])


def capture(graph: Graph, config: EnvironmentConfig, *plugins: object) -> Application:
    """Collect the definitions of the application, in its own process.

    Args:
        graph: The application's dataflow.
        config: Its environment, whose plug-ins may be the application's own.
        plugins: Instances of its classes outside the graph, such as schedulers.
    """
    used = [*_used(graph), *plugins]
    files = _main_files(used)
    named = [name.partition(":") for name in _plugin_names(config) if ":" in name]
    names = [module for module, _, _ in named]
    names += [one.__module__ for one in _mentioned(used)]
    names += [one.__module__ for one in used if isinstance(one, types.FunctionType)]
    folders: list[str] = []
    for namespace in files:
        names += _imports_of(namespace, folders)
    own = own_modules(names, folders)
    # Ray runs a container with nothing of its own in it.
    by_value = any(env.image_uri for env in _environments(graph, config))
    late = {name for name in own if by_value or not ray_cluster.brings(name, own[name])}
    definitions: dict[str, bytes] = {}
    attributes: dict[str, dict[str, str]] = {}
    for number, namespace in enumerate([*files, *_by_value(late)]):
        name = main_name(namespace)
        wanted = {attribute for module, _, attribute in named if module == name}
        prefix = f"{uuid.uuid4().hex[:12]}-{number}"
        defined = _define(prefix, [*_classes(namespace), *_functions(namespace, wanted)])
        definitions |= defined
        if name is not None and not is_installed(name):
            attributes.setdefault(name, {key.partition("/")[2]: key for key in defined})
    local = [one for one in _mentioned(used) if "<locals>" in one.__qualname__]
    definitions |= _define(f"{uuid.uuid4().hex[:12]}-local", local)
    brought = tuple(path for name, path in own.items() if name not in late)
    return Application(definitions, attributes, brought)


def _by_value(names: Collection[str]) -> Iterator[dict[str, Any]]:
    """Namespaces of the loaded modules of these top-level names, which travel by value now on."""
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] in names and isinstance(module, types.ModuleType):
            cloudpickle.register_pickle_by_value(module)
            yield vars(module)


def main_modules() -> tuple[Path, ...]:
    """Files and folders of the own modules that the application's file imports."""
    names: list[str] = []
    folders: list[str] = []
    for namespace in _main_files(()):
        names += _imports_of(namespace, folders)
    return tuple(own_modules(names, folders).values())


def _environments(graph: Graph, config: EnvironmentConfig) -> Iterator[RuntimeEnvConfig]:
    yield from config.runtime_env.values()
    yield from (node.runtime_env for node in graph.nodes.values() if node.runtime_env is not None)


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
    """Namespaces of files that run as `__main__`: the application's own."""
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
        if isinstance(value, type) and value.__module__ == namespace.get("__name__"):
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


def _imports_of(namespace: dict[str, Any], folders: list[str]) -> list[str]:
    """Names that a file that runs as `__main__` imports; adds its folder to `folders`."""
    try:
        file = Path(namespace["__file__"]).resolve()
        text = file.read_bytes()
    except (KeyError, TypeError, OSError):
        return []
    folders.append(str(file.parent))
    return [namespace.get("__package__") or "", *imported_names(text)]
