"""The application's own code, as it reaches every process of its run.

Modules travel with Ray's job, by its `runtime_env`. What runs as `__main__`, and modules that the
job lacks because they were imported or changed after it was joined, travel by value: their classes
with the objects and messages that need them, and here for whoever imports them by name.
"""

from __future__ import annotations

import contextlib
import inspect
import pickle
import sys
import types
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from ray import cloudpickle

from aerodaas.actors.cluster import ray_cluster
from aerodaas.actors.run.own_modules import imported_names, is_installed, own_modules
from aerodaas.config.model import EnvironmentConfig, RuntimeEnvConfig
from aerodaas.config.plugins import main_name
from aerodaas.dataflow.graph import Graph

__all__ = ["Application", "capture", "main_modules"]

_LARGEST = 1 << 20
"""Bytes of a class beyond which it is sent only with the items that need it."""


@dataclass(frozen=True)
class Application:
    """Modules of an application that travel by value; unpickling it makes them available."""

    modules: Mapping[str, Mapping[str, bytes]] = field(default_factory=dict)
    """Pickled classes and functions by name, by name of their module."""
    files: tuple[Path, ...] = ()
    """Files and folders of the modules that Ray's job brings along; they stay here."""

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """Pickle it so that unpickling makes its modules available."""
        return _arrived, (dict(self.modules),)


def _arrived(modules: dict[str, dict[str, bytes]]) -> Application:
    for name, definitions in modules.items():
        if name not in sys.modules:
            module = types.ModuleType(name, "The application's own file, by what it defines.")
            vars(module)["__getattr__"] = partial(_defined, name, definitions)
            sys.modules[name] = module
    return Application(modules)


def _defined(module: str, definitions: dict[str, bytes], name: str) -> Any:  # noqa: ANN401 - a class
    if name not in definitions:
        raise AttributeError(f"{module} defines no class {name!r} that could be sent")
    return _built(definitions[name])


@lru_cache(maxsize=1024)
def _built(definition: bytes) -> Any:  # noqa: ANN401 - a class
    return pickle.loads(definition)  # noqa: S301 - the application's own


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
    modules: dict[str, dict[str, bytes]] = {}
    for namespace in [*files, *_by_value(late)]:
        name = main_name(namespace)
        if name is not None and not is_installed(name):
            wanted = {attribute for module, _, attribute in named if module == name}
            modules.setdefault(name, _definitions(namespace, wanted))
    brought = tuple(path for name, path in own.items() if name not in late)
    return Application(modules, brought)


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


def _definitions(namespace: dict[str, Any], wanted: set[str]) -> dict[str, bytes]:
    """Pickle a module's own classes, and what is `wanted` of it, but for what cannot be."""
    found: dict[str, bytes] = {}
    for name, value in list(namespace.items()):
        own = isinstance(value, type) and value.__module__ == namespace.get("__name__")
        if own or name in wanted:
            # What cannot be pickled is reported where it is used.
            with contextlib.suppress(Exception):
                data = cloudpickle.dumps(value, protocol=5)  # pyright: ignore[reportPrivateImportUsage]
                if len(data) <= _LARGEST:
                    found[name] = data
    return found


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
