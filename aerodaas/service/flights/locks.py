"""Locks of flights and drones: files that a living process holds, and the kernel frees at its end.

They hold whatever a database says, and whatever has become of the service.
"""

from __future__ import annotations

import contextlib
import fcntl
import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO

from aerodaas.types.errors import MissionError

__all__ = ["RobotLocks", "exclusive", "is_locked"]

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


class RobotLocks:
    """One lock for each drone of a provider: the process that flies a drone holds its lock."""

    def __init__(self, folder: Path) -> None:
        """Keep them in `folder`, which need not exist."""
        self._folder = folder

    @contextlib.contextmanager
    def hold(self, robots: Collection[str]) -> Iterator[None]:
        """Hold the locks of `robots`; raises MissionError for one that another process holds."""
        self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with contextlib.ExitStack() as held:
            for robot in robots:
                refusal = (
                    f"another process still flies {robot}: submit the mission again once that "
                    "flight is over"
                )
                held.enter_context(exclusive(self._folder / robot, refusal))
            yield

    def held(self, robots: Collection[str]) -> set[str]:
        """Those of `robots` whose lock a living process holds."""
        return {robot for robot in robots if is_locked(self._folder / robot)}
