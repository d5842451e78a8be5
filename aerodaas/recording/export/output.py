"""Output files of exports; existing files are never overwritten."""

from __future__ import annotations

import re
from pathlib import Path

from aerodaas.types.errors import RecordingError

__all__ = ["file_name", "new_file"]


def file_name(topic: str) -> str:
    """File name, without suffix, for a topic: `/tello/camera/image` -> `tello-camera-image`."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", topic).strip("-")


def new_file(path: Path) -> Path:
    """Create the folder of `path`; raises RecordingError if the file exists or this fails."""
    if path.exists():
        raise RecordingError(
            f"{path} already exists and is not overwritten; give another folder with --out"
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot make the folder {path.parent}: {error.strerror}") from None
    return path
