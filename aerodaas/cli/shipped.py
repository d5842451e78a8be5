"""What the package brings along for users: applications to fly, and templates to begin from."""

from __future__ import annotations

import ast
import difflib
from pathlib import Path

import aerodaas
from aerodaas.errors import ConfigError

__all__ = ["APPLICATIONS", "TEMPLATES", "find_application", "purpose", "shipped_applications"]

_PACKAGE = Path(aerodaas.__file__).parent
APPLICATIONS = _PACKAGE / "apps"
"""Folder of the applications that ship, their environment files in `environments/`."""
TEMPLATES = _PACKAGE / "templates"
"""Folder of the templates, a folder each."""


def shipped_applications() -> dict[str, Path]:
    """The applications that ship, by name."""
    return {path.stem: path for path in sorted(APPLICATIONS.glob("*.py"))}


def find_application(given: Path) -> Path:
    """The application's file: the given one, or the one that ships under this name.

    Raises:
        ConfigError: If there is neither, with the names that are close.
    """
    if given.is_file():
        return given
    shipped = shipped_applications()
    if not given.exists() and given.name == str(given) and given.stem in shipped:
        return shipped[given.stem]
    raise ConfigError(f"there is no application {given}{_remedy(given, list(shipped))}")


def purpose(application: Path) -> str:
    """The first line of an application's docstring, without its name and its full stop."""
    text = ast.get_docstring(ast.parse(application.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0].partition(": ")[2].partition(" (paper")[0].rstrip(".")


def _remedy(given: Path, shipped: list[str]) -> str:
    folder = given.parent
    beside = [path.name for path in folder.glob("*.py")] if folder.is_dir() else []
    close = difflib.get_close_matches(given.name, [*beside, *shipped], n=1)
    if close:
        meant = folder / close[0] if close[0] in beside else close[0]
        return f" (did you mean {meant}?)"
    return "; `aerodaas examples` copies those that ship, `aerodaas new` begins one"
