"""Detection of whether a target stands, as a person who falls, lies or gets up does not walk."""

from __future__ import annotations

from collections import deque

from aerodaas.clock import seconds

__all__ = ["Upright"]

_SPAN = 0.15
"""Seconds between two compared sightings; shorter spans would measure the noise of boxes."""
_FASTEST, _FASTEST_SHARE = 0.8, 0.3
"""Vertical speed in m/s above which a target falls or gets up, and its increase per metre of
distance, because an attitude error moves distant objects more."""
_KEPT = 8
_LOW = 0.6
"""Fraction of its standing height below which a fallen target is still down."""


class Upright:
    """Tracks the height of the target's upper edge, which shows a fall even without the feet.

    A falling person's chest moves a metre sideways within half a second. A follower that took
    this for walking would fly after it, over the person's feet.
    """

    def __init__(self) -> None:
        """Start without sightings."""
        self._looks: deque[tuple[int, float]] = deque(maxlen=_KEPT)
        self._stood: float | None = None
        """Height before the fall, metres."""

    def reset(self) -> None:
        """Discard the target."""
        self._looks.clear()
        self._stood = None

    def stands(self, top: float, distance: float, stamp: int) -> bool:
        """Add a sighting of the target's upper edge, `top` metres above home.

        Returns False while it moves up or down faster than a walking person's, and after a fall
        until it is up again.
        """
        before = self._before(stamp)
        self._looks.append((stamp, top))
        if before is not None:
            then, height = before
            fastest = max(_FASTEST, _FASTEST_SHARE * distance) * seconds(stamp - then)
            if height - top > fastest and self._stood is None:
                self._stood = height
            if abs(height - top) > fastest:
                return False
        if self._stood is not None and top < _LOW * self._stood:
            return False
        self._stood = None
        return True

    def _before(self, stamp: int) -> tuple[int, float] | None:
        """Newest sighting that is old enough for a comparison."""
        earlier = (look for look in reversed(self._looks) if seconds(stamp - look[0]) >= _SPAN)
        return next(earlier, None)
