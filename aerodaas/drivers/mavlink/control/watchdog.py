"""Watchdog of the control loop above the driver, a condition of heartbeats and setpoints."""

from __future__ import annotations

import math
import threading
import time

from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase

__all__ = ["Watchdog"]

_SILENT = 1.0
"""Seconds without a turn of the loop, which turns 20 times a second."""
_STALL = 0.5
"""Seconds between two steps, which come 20 times a second, in which the whole process stood still:
the loop had no chance to turn."""
_GONE = 20.0
"""Seconds without a turn after which the loop counts as dead."""


class Watchdog:
    """Watchdog fed by each turn of the loop."""

    def __init__(self) -> None:
        self._fed_at = self._stepped_at = -math.inf
        self._loop: int | None = None
        self._left_alone: FlightMode | None = None
        """What a vehicle was asked for because the loop hangs."""

    def belong(self) -> None:
        """Accept only the calling thread as the loop; other threads read states, too."""
        self._loop = threading.get_ident()
        self.feed()

    def feed(self) -> None:
        """Record a turn of the loop."""
        if self._loop in {None, threading.get_ident()}:
            self._fed_at = time.monotonic()

    def healthy(self, now: float) -> bool:
        """Whether the loop turns."""
        return now - self._fed_at < _SILENT

    def gone(self, now: float) -> bool:
        """Whether the loop has stopped for so long that it counts as dead."""
        return now - self._fed_at > _GONE

    def step(self, now: float, phase: FlightPhase) -> FlightMode | None:
        """Flight mode to request because the loop hangs, each mode once; called 20 times a second.

        Args:
            now: Monotonic clock, seconds.
            phase: Phase of the flight.
        """
        since, self._stepped_at = now - self._stepped_at, now
        if _STALL < since < math.inf:
            self._fed_at = min(now, self._fed_at + since)
        if not phase.ours or self.healthy(now):
            self._left_alone = None
            return None
        step = FlightMode.RETURN if self.gone(now) else FlightMode.HOLD
        # Nobody guards a plan either.
        guarded = phase.wish in {FlightMode.GUIDED, FlightMode.MISSION}
        if step is self._left_alone or not (guarded or step is FlightMode.RETURN):
            return None
        self._left_alone = step
        return step
