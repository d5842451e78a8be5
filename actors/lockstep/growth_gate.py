"""Where a lockstep's time stands still, between two measurements.

What counts a measurement's readers must change between two measurements: the conductor first lets
everything that is under way be done, then holds mission time until all actors know of the change.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

__all__ = ["GrowthGate"]

_LONGEST_HOLD = 120.0
"""Wall seconds after which time goes on, should the application have died meanwhile."""
_LOOK_INTERVAL = 0.02


class GrowthGate:
    """Holds mission time for other threads."""

    def __init__(self, serve: Callable[[], object]) -> None:
        """Let time go on; while it stands still, `serve` is called, in the loop's thread."""
        self._serve = serve
        self._wanted = False
        self._still = threading.Event()

    def hold(self, timeout: float) -> bool:
        """Have time stand still; False if it does not within `timeout` wall seconds."""
        self._wanted = True
        return self._still.wait(timeout)

    def release(self) -> None:
        """Let time go on."""
        self._wanted = False

    def visit(self, settle: Callable[[], None]) -> None:
        """Where time may stand still, in the loop's thread; `settle` is called before it does."""
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
