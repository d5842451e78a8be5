"""The application's own modules as source text, and their import in other processes.

Own modules are neither installed nor shipped with Python: files and packages beside the
application, plug-in folders. Other processes import the application's source text, so all
processes of a run use the same version of a file.
"""

from __future__ import annotations

import ast
import importlib.util
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.abc import ExecutionLoader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

__all__ = ["Source", "imported_names", "own_sources", "serve"]

_INSTALLED = ("site-packages", "dist-packages")


@dataclass(frozen=True)
class Source:
    """Source text of one module or package."""

    text: bytes
    """Content of the file; empty for a package without a file of its own."""
    file: str
    """Path on the application's machine; other machines may lack it."""
    folders: tuple[str, ...] | None = None
    """Folders of a package; None for a module."""


def own_sources(seeds: Iterable[tuple[str, list[str]]]) -> dict[str, Source]:
    """Own modules among `seeds` and all their imports, by name.

    A seed is a module's name and the folders to search besides `sys.path`.
    """
    found: dict[str, Source] = {}
    seen: set[str] = set()
    waiting = list(seeds)
    while waiting:
        name, folders = waiting.pop()
        parent, _, _ = name.rpartition(".")
        if name in seen or not name or not _may_be_own(name):
            continue
        seen.add(name)
        source = _source(name, folders)
        if source is None:
            continue
        found[name] = source
        package = name if source.folders is not None else parent
        names = [parent, *imported_names(source.text, package)]
        waiting += [(one, folders) for one in names]
    # A module whose package is not own cannot be served.
    return {name: one for name, one in found.items() if _rooted(name, found)}


def _rooted(name: str, found: Mapping[str, Source]) -> bool:
    parent, _, _ = name.rpartition(".")
    return not parent or (parent in found and _rooted(parent, found))


def _may_be_own(name: str) -> bool:
    top = name.partition(".")[0]
    return top not in sys.stdlib_module_names and top not in {"aerodaas", "__main__", "__mp_main__"}


def _source(name: str, folders: list[str]) -> Source | None:
    loaded = sys.modules.get(name)
    spec = getattr(loaded, "__spec__", None) or _found(name, folders)
    if spec is None:
        return None
    if spec.submodule_search_locations is not None and not spec.has_location:
        paths = tuple(spec.submodule_search_locations)
        own = paths and all(_is_own(Path(path)) for path in paths)
        return Source(b"", "", paths) if own else None
    origin = Path(spec.origin or "")
    if not spec.has_location or origin.suffix != ".py" or not _is_own(origin):
        return None
    inside = spec.submodule_search_locations
    try:
        return Source(origin.read_bytes(), str(origin), None if inside is None else tuple(inside))
    except OSError:
        return None


def _found(name: str, folders: list[str]) -> ModuleSpec | None:
    """Find the spec of a module without importing it or its packages."""
    parent, _, _ = name.rpartition(".")
    try:
        if not parent:
            return PathFinder.find_spec(name, folders) or importlib.util.find_spec(name)
        package = getattr(sys.modules.get(parent), "__spec__", None) or _found(parent, folders)
        paths = package.submodule_search_locations if package is not None else None
        return PathFinder.find_spec(name, list(paths)) if paths else None
    except (ImportError, ValueError, AttributeError):
        return None


@lru_cache(maxsize=4096)
def _is_own(path: Path) -> bool:
    path = path.resolve()
    if any(part in _INSTALLED for part in path.parts):
        return False
    shipped = (Path(sysconfig.get_paths()[name]).resolve() for name in ("stdlib", "platstdlib"))
    return not any(path.is_relative_to(folder) for folder in shipped)


@lru_cache(maxsize=1024)
def imported_names(text: bytes, package: str) -> tuple[str, ...]:
    """Names that a source imports anywhere; `package` is the base of relative imports."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return ()
    return tuple(dict.fromkeys(_imports(tree, package)))


def _imports(tree: ast.AST, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parts, base] if base else parts)
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


class _Loader(ExecutionLoader):
    def __init__(self, source: Source) -> None:
        self._source = source

    def get_source(self, fullname: str) -> str:  # noqa: ARG002 - the base's
        return importlib.util.decode_source(self._source.text)

    def get_filename(self, fullname: str) -> str:  # noqa: ARG002 - the base's
        return self._source.file

    def is_package(self, fullname: str) -> bool:  # noqa: ARG002 - the base's
        return self._source.folders is not None


class _Finder(MetaPathFinder):
    def __init__(self) -> None:
        self.sources: dict[str, Source] = {}

    def find_spec(
        self,
        fullname: str,
        path: Any = None,  # noqa: ANN401, ARG002 - the base's
        target: ModuleType | None = None,  # noqa: ARG002 - the base's
    ) -> ModuleSpec | None:
        source = self.sources.get(fullname)
        if source is None:
            return None
        return importlib.util.spec_from_file_location(
            fullname,
            source.file or None,
            loader=_Loader(source),
            submodule_search_locations=None if source.folders is None else list(source.folders),
        )


_finder = _Finder()


def serve(sources: Mapping[str, Source]) -> None:
    """Make this process import the modules `sources`, by name, from their source text."""
    if _finder not in sys.meta_path:
        sys.meta_path.insert(0, _finder)
    _finder.sources.update(sources)
