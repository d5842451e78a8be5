"""A file that a target writes each input to, for readers that take a path."""

from __future__ import annotations

import atexit
import os
import tempfile
from pathlib import Path

__all__ = ["scratch_file"]


def scratch_file(suffix: str) -> Path:
    """Make an empty file of this process, with this ending, which is gone when the process ends."""
    handle, name = tempfile.mkstemp(suffix=suffix, prefix="fuzz-")
    os.close(handle)
    path = Path(name)
    atexit.register(path.unlink, missing_ok=True)
    return path
