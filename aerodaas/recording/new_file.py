"""Output files of exports: existing ones are never overwritten, and no cell is a formula."""

from __future__ import annotations

import re
from hashlib import blake2b
from pathlib import Path

from aerodaas.errors import RecordingError

__all__ = ["file_name", "harmless", "new_file"]

_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of formulas, by OWASP's "CSV Injection"."""
_LONGEST = 100
"""Most characters of a name from a recording, which may have any; systems take 255 bytes."""


def harmless(cell: object) -> object:
    """A cell; a text that a spreadsheet would compute is led by an apostrophe (OWASP)."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULAS) else cell


def file_name(topic: str) -> str:
    """File name, without suffix, for a topic: `/tello/camera/image` -> `tello-camera-image`.

    What is too long is cut, and ends with a digest that tells it from others that begin so.
    """
    name = re.sub(r"[^A-Za-z0-9_]+", "-", topic).strip("-")
    if len(name) <= _LONGEST:
        return name
    digest = blake2b(topic.encode(errors="replace"), digest_size=4).hexdigest()
    return f"{name[: _LONGEST - len(digest) - 1]}-{digest}"


def new_file(path: Path) -> Path:
    """Create the folder of `path`; raises RecordingError if the file exists or this fails."""
    try:
        exists = path.exists()
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot make the folder {path.parent}: {error.strerror}") from None
    if exists:
        raise RecordingError(
            f"{path} already exists and is not overwritten; give another folder with --out"
        )
    return path
