"""Files that their owner alone may read, written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

__all__ = ["write_private"]


def write_private(path: Path, content: str | bytes) -> None:
    """Write a file of mode 0600 in the place of an earlier one.

    Whoever reads it finds the former content or the new one, also after a crash of the machine;
    a failure leaves the former one, and no other file.

    Args:
        path: The file.
        content: Its content; a text is written as UTF-8.

    Raises:
        OSError: If it cannot be written.
    """
    # `mkstemp` makes files of mode 0600; on the same file system the renaming is atomic.
    handle, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise
