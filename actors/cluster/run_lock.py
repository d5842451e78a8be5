"""Lock that keeps this process's local Ray running until it is released or the process ends."""

from __future__ import annotations

import fcntl
import os
import uuid
from pathlib import Path

from aerodaas.actors.cluster.ray_process import LOCKS, VARIABLE

__all__ = ["RunLock"]


class RunLock:
    """Lock of an active run, held once constructed; without effect on a remote cluster.

    It is a POSIX record lock, which child processes do not inherit.
    """

    def __init__(self) -> None:
        folder = os.environ.get(VARIABLE)
        self._path = Path(folder) / LOCKS / uuid.uuid4().hex if folder else None
        if self._path is not None:
            self._file = self._path.open("w")
            fcntl.lockf(self._file, fcntl.LOCK_EX)

    def release(self) -> None:
        """Release the lock."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)
            self._file.close()
            self._path = None
