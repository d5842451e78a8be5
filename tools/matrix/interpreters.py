"""Finds Python interpreters: on the path, pyenv's, uv's."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

__all__ = ["MINORS", "interpreter"]

MINORS = (10, 11, 12, 13)
"""Minor versions of Python 3 that the project supports."""
_PYENV = Path("~/.pyenv/versions")


def interpreter(minor: int) -> str | None:
    """Path of a working Python 3.`minor`; None if there is none."""
    for candidate in _candidates(minor):
        told = _ask([candidate, "-c", "import sys, venv; print(sys.version_info.minor)"])
        if told == str(minor):
            return candidate
    return None


def _candidates(minor: int) -> Iterator[str]:
    found = shutil.which(f"python3.{minor}")
    if found:
        yield found
    for folder in sorted(_PYENV.expanduser().glob(f"3.{minor}.*"), reverse=True):
        yield str(folder / "bin" / "python")
    found = _ask(["uv", "python", "find", "--no-python-downloads", f"3.{minor}"])
    if found:
        yield found


def _ask(command: list[str]) -> str:
    """What a program prints; nothing if it fails or is not there."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)  # noqa: S603 - ours
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
