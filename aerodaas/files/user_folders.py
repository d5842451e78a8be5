"""Folders of the user for what this package keeps, by the XDG base directory specification."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["cache_folder", "config_folder", "state_folder"]


def cache_folder() -> Path:
    """Folder of files that can be fetched again."""
    return _folder("XDG_CACHE_HOME", ".cache")


def config_folder() -> Path:
    """Folder of the user's settings."""
    return _folder("XDG_CONFIG_HOME", ".config")


def state_folder() -> Path:
    """Folder of state that outlives a process."""
    return _folder("XDG_STATE_HOME", ".local/state")


def _folder(variable: str, otherwise: str) -> Path:
    # A path that is not absolute is to be ignored, says the specification.
    named = Path(os.environ.get(variable, ""))
    return (named if named.is_absolute() else Path.home() / otherwise) / "aerodaas"
