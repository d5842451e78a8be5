"""The application's own modules: those that are neither installed nor shipped with Python.

Files and packages beside the application or in a plug-in folder are its own. Processes on other
machines lack them, so the run brings them along (docs/cluster.md).
"""

from __future__ import annotations

import ast
import importlib.util
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from importlib.machinery import PathFinder
from pathlib import Path

__all__ = ["imported_names", "is_installed", "own_modules"]

_INSTALLED = ("site-packages", "dist-packages")
_EVERYWHERE = sys.stdlib_module_names | {"aerodaas", "__main__", "__mp_main__"}


def own_modules(names: Iterable[str], folders: Sequence[str]) -> dict[str, Path]:
    """Own modules among `names` and all that they import, by top-level name.

    Args:
        names: Names of modules or of parts of packages.
        folders: Folders to search besides `sys.path`.

    Returns:
        The file of a module, or the folder of a package.
    """
    found: dict[str, Path] = {}
    waiting = list(names)
    while waiting:
        name = waiting.pop().partition(".")[0]
        if not name or name in found or name in _EVERYWHERE:
            continue
        path = _path_of(name, folders)
        if path is not None:
            found[name] = path
            for file in path.rglob("*.py") if path.is_dir() else [path]:
                waiting += imported_names(file.read_bytes())
    return found


def is_installed(name: str) -> bool:
    """Whether every process can import the module of this name, as it can `pytest`."""
    try:
        return importlib.util.find_spec(name) is not None and _path_of(name, ()) is None
    except (ImportError, ValueError):
        return False


def _path_of(name: str, folders: Sequence[str]) -> Path | None:
    """File or folder of an own module, which is not imported; None for any other."""
    try:
        spec = getattr(sys.modules.get(name), "__spec__", None)
        spec = spec or PathFinder.find_spec(name, list(folders)) or importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None
    if spec is None:
        return None
    within = list(spec.submodule_search_locations or ())
    path = Path(within[0] if within else spec.origin or "")
    own = path.is_dir() if within else path.suffix == ".py" and path.is_file()
    return path if own and _is_own(path) else None


@lru_cache(maxsize=4096)
def _is_own(path: Path) -> bool:
    path = path.resolve()
    if any(part in _INSTALLED for part in path.parts):
        return False
    shipped = (Path(sysconfig.get_paths()[name]).resolve() for name in ("stdlib", "platstdlib"))
    return not any(path.is_relative_to(folder) for folder in shipped)


@lru_cache(maxsize=1024)
def imported_names(text: bytes) -> tuple[str, ...]:
    """Names that a source imports anywhere, but for relative imports."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return ()
    return tuple(dict.fromkeys(_imports(tree)))


def _imports(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module or ""
