"""Locks of a provider's drones, which hold whatever its database says.

The process of a flight holds the lock of each of its drones; so does the actor that flies it, which
brings it home where that process is killed.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator
from pathlib import Path

from aerodaas.config.file_lock import actor_lock, exclusive, is_locked
from aerodaas.errors import MissionError

__all__ = ["RobotLocks"]


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
                if is_locked(actor_lock(self._folder, robot)):
                    raise MissionError(refusal)
            yield

    def held(self, robots: Collection[str]) -> set[str]:
        """Those of `robots` whose lock a living process holds."""
        return {
            robot
            for robot in robots
            if is_locked(self._folder / robot) or is_locked(actor_lock(self._folder, robot))
        }
