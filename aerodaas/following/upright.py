"""Whether a target stands: whoever falls, lies or gets up does not walk."""

from __future__ import annotations

from collections import deque

from aerodaas.types.clock import seconds

__all__ = ["Upright"]

_SPAN = 0.15
"""Seconds between two looks that are compared; less would measure the noise of boxes."""
_FASTEST, _FASTEST_SHARE = 0.8, 0.3
"""m/s up or down from which a target falls or gets up, and that for each metre of distance, for
an attitude that is a little wrong moves what is far away more."""
_KEPT = 8
_LOW = 0.6
"""Parts of its height when it stood, below which a target that sank so fast is still down."""


class Upright:
    """Follows the height of the target's upper edge, which tells a fall even without the feet.

    A falling person's chest goes a metre aside within half a second. A follower that took this
    for walking would fly after it, over the person's feet.
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self._looks: deque[tuple[int, float]] = deque(maxlen=_KEPT)
        self._stood: float | None = None
        """The height from which it fell."""

    def reset(self) -> None:
        """Forget the target."""
        self._looks.clear()
        self._stood = None

    def stands(self, top: float, distance: float, stamp: int) -> bool:
        """Take in a look at the target's upper edge, `top` metres above home.

        False while it goes up or down faster than anybody who walks, and after a fall until it is
        up again.
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
        """The newest look that is old enough to be compared with."""
        earlier = (look for look in reversed(self._looks) if seconds(stamp - look[0]) >= _SPAN)
        return next(earlier, None)
