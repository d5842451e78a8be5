"""Which cameras of a flight are shared with which attached missions, kept by its own process."""

from __future__ import annotations

import threading
from collections.abc import Iterable

__all__ = ["Sharing"]


class Sharing:
    """Cameras by attached mission; safe in any thread.

    It is asked before each picture, beside the drone: what is withdrawn ends here, whatever
    becomes of the service and of the attached mission's process.
    """

    def __init__(self) -> None:
        """Share nothing."""
        self._lock = threading.Lock()
        self._streams: dict[str, frozenset[str]] = {}

    def share(self, mission: str, streams: Iterable[str]) -> None:
        """Share these cameras with a mission from now on, and no others."""
        with self._lock:
            self._streams[mission] = frozenset(streams)

    def withdraw(self, mission: str) -> None:
        """Share nothing with a mission any more."""
        with self._lock:
            self._streams.pop(mission, None)

    def allows(self, mission: str, stream: str) -> bool:
        """Whether a mission may have the next picture of a camera."""
        with self._lock:
            return stream in self._streams.get(mission, ())
