"""Touchdown of a drone that only tells where it is."""

from __future__ import annotations

import math
from collections import deque

from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import FlightEnd

__all__ = ["Touchdown"]

_NEAR = 0.3
"""Metres from the height of the take-off within which ground is expected."""
_STILL_NEAR, _STILL_ELSEWHERE = 1.0, 5.0
"""Seconds of standing still, although a descent is commanded, that make a landing there."""
_STILL = 0.05
"""Metres of height within which it stands still."""
_OBEYED = 0.2
"""Metres that it must have come down by, so that standing still tells of a ground and not of a
drone that does not listen."""
_FEWEST = 5
"""Readings that it takes to call something still."""
_FALL = 2.0
"""m/s downwards that is no landing."""


class Touchdown:
    """Follows one landing by the heights of fresh odometry, while a descent is commanded.

    Velocities are not used to call it still: some publishers leave them zero.
    """

    def __init__(self, ground: float) -> None:
        """Expect the ground at the height `ground`, metres."""
        self._ground = ground
        self._heights: deque[tuple[float, float]] = deque()
        self._highest = -math.inf
        self._fastest = 0.0

    def observe(self, odometry: Odometry, now: float) -> None:
        """Take fresh odometry, heard at `now` (seconds).

        Args:
            odometry: The drone's, in the local frame.
            now: Monotonic clock, seconds.
        """
        height = float(odometry.position[2])
        self._highest = max(self._highest, height)
        self._fastest = max(self._fastest, -float(odometry.velocity[2]))
        self._heights.append((now, height))
        while now - self._heights[0][0] > _STILL_ELSEWHERE + 1.0:
            self._heights.popleft()

    def end(self, now: float) -> FlightEnd | None:
        """How the landing ended, at `now` (seconds); None while it goes on."""
        if not self._heights:
            return None
        newest = self._heights[-1][1]
        near = newest < self._ground + _NEAR
        if not near and self._highest - newest < _OBEYED:
            return None
        seconds = _STILL_NEAR if near else _STILL_ELSEWHERE
        if now - self._heights[0][0] < seconds:
            return None
        recent = [height for at, height in self._heights if now - at <= seconds]
        if len(recent) < _FEWEST or max(recent) - min(recent) > _STILL:
            return None
        return FlightEnd.FELL if self._fastest > _FALL else FlightEnd.LANDED
