"""Lock files: a living process holds one, and the kernel frees it when that process ends."""

from __future__ import annotations

import contextlib
import fcntl
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from aerodaas.errors import MissionError

__all__ = ["actor_lock", "exclusive", "is_locked"]

_PATIENCE = 1.0
"""Seconds to wait for a lock: whoever looks at it holds it for a moment, too."""
_AGAIN_SECONDS = 0.02


@contextlib.contextmanager
def exclusive(path: Path, refusal: str) -> Iterator[None]:
    """Hold the lock in the file `path`.

    Args:
        path: The file, which need not exist.
        refusal: What the error says.

    Raises:
        MissionError: If another process holds it.
    """
    until = time.monotonic() + _PATIENCE
    with path.open("w") as lock:
        while not _taken(lock):
            if time.monotonic() > until:
                raise MissionError(refusal)
            time.sleep(_AGAIN_SECONDS)
        yield


def _taken(lock: IO[str]) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def is_locked(path: Path) -> bool:
    """Whether a living process holds the lock in the file `path`; a killed one holds none."""
    try:
        with path.open("r") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def actor_lock(folder: Path, robot: str) -> Path:
    """The lock file of the actor that flies a robot.

    Args:
        folder: Folder of a provider's locks.
        robot: Id of the robot.
    """
    return folder / f"{robot}.actor"
