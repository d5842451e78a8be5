"""Filter of the battery's percentage, which jumps with damaged packets and load changes."""

from __future__ import annotations

import statistics
from collections import deque

from aerodaas.messages.odometry import Battery

__all__ = ["BatteryGauge"]

_WINDOW = 9
"""Packets, 0.9 s: a reading must hold for half of it before it counts."""


class BatteryGauge:
    """The median of the newest percentages."""

    def __init__(self) -> None:
        """Start without a reading."""
        self._percent: deque[int] = deque(maxlen=_WINDOW)

    def add(self, percent: int) -> None:
        """Add the percentage of one packet, 0 to 100."""
        self._percent.append(percent)

    @property
    def battery(self) -> Battery:
        """Present charge; NaN before the first packet."""
        if not self._percent:
            return Battery(float("nan"))
        return Battery(statistics.median(self._percent) / 100)
