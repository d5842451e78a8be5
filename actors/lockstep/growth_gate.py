"""Gate that holds lockstep mission time between two measurements, for changes to the graph.

The number of a measurement's readers may change only between two measurements: the setpoint loop
first lets all current ones be processed, then holds mission time until all actors have the
change.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

__all__ = ["GrowthGate"]

_LONGEST_HOLD = 120.0
"""Wall seconds after which time advances again, in case the application has died."""
_LOOK_INTERVAL = 0.02


class GrowthGate:
    """Gate by which other threads hold mission time."""

    def __init__(self, serve: Callable[[], object]) -> None:
        """Create an open gate; while time is held, `serve` is called in the loop's thread."""
        self._serve = serve
        self._wanted = False
        self._still = threading.Event()

    def hold(self, timeout: float) -> bool:
        """Hold time; returns False if it is not held within `timeout` wall seconds."""
        self._wanted = True
        return self._still.wait(timeout)

    def release(self) -> None:
        """Let time advance again."""
        self._wanted = False

    def visit(self, settle: Callable[[], None]) -> None:
        """Hold time here if requested, in the loop's thread, after a call of `settle`."""
        if not self._wanted:
            return
        settle()
        self._still.set()
        until = time.monotonic() + _LONGEST_HOLD
        while self._wanted and time.monotonic() < until:
            self._serve()
            time.sleep(_LOOK_INTERVAL)
        self._wanted = False
        self._still.clear()
