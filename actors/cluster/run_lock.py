"""A lock that keeps the local Ray of this process up until the process lets go of it or ends."""

from __future__ import annotations

import fcntl
import os
import uuid
from pathlib import Path

from aerodaas.actors.cluster.ray_process import LOCKS, VARIABLE

__all__ = ["RunLock"]


class RunLock:
    """Lock held from construction on; does nothing on a cluster, which no run here may end.

    It is a POSIX record lock, which a process' children do not inherit.
    """

    def __init__(self) -> None:
        folder = os.environ.get(VARIABLE)
        self._path = Path(folder) / LOCKS / uuid.uuid4().hex if folder else None
        if self._path is not None:
            self._file = self._path.open("w")
            fcntl.lockf(self._file, fcntl.LOCK_EX)

    def release(self) -> None:
        """Let go."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)
            self._file.close()
            self._path = None
