"""Pauses between attempts to reach a provider's service."""

from __future__ import annotations

import random
from collections.abc import Iterator

__all__ = ["pauses"]

_FIRST_PAUSE = 0.5
_LONGEST_PAUSE = 10.0
"""Seconds between two attempts to connect again."""


def pauses() -> Iterator[float]:
    """Yield pauses between attempts: doubled each time, and spread, so that clients do not meet."""
    pause = _FIRST_PAUSE
    while True:
        yield pause * random.uniform(0.5, 1.0)
        pause = min(2.0 * pause, _LONGEST_PAUSE)
