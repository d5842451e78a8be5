"""Whether the control loop above the driver is alive; heartbeats and setpoints rest on it."""

from __future__ import annotations

import math
import threading
import time

__all__ = ["Watchdog"]

_SILENT = 1.0
"""Seconds without a turn of the loop, which turns 20 times a second."""
_GONE = 20.0
"""Seconds after which the loop is taken for dead."""


class Watchdog:
    """Fed by each turn of the loop."""

    def __init__(self) -> None:
        self._fed_at = -math.inf
        self._loop: int | None = None

    def belong(self) -> None:
        """From now on only the calling thread is the loop; others read states, too."""
        self._loop = threading.get_ident()
        self.feed()

    def feed(self) -> None:
        """The loop has come round."""
        if self._loop in {None, threading.get_ident()}:
            self._fed_at = time.monotonic()

    def healthy(self, now: float) -> bool:
        """Whether the loop turns."""
        return now - self._fed_at < _SILENT

    def gone(self, now: float) -> bool:
        """Whether the loop has been still for so long that it is taken for dead."""
        return now - self._fed_at > _GONE
