"""Whether a target keeps its height: whoever falls or gets up does not walk."""

from __future__ import annotations

from collections import deque

from aerodaas.clock import seconds

__all__ = ["Upright"]

_SPAN = 0.15
"""Seconds between two looks that are compared; less would measure the noise of boxes."""
_FASTEST, _FASTEST_SHARE = 0.8, 0.3
"""m/s up or down from which a target falls or gets up, and that for each metre of distance, for
an attitude that is a little wrong moves what is far away more."""
_KEPT = 8


class Upright:
    """Follows the height of the target's middle.

    A falling person's chest goes a metre aside within half a second. A follower that took this
    for walking would fly after it, over the person's feet.
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self._looks: deque[tuple[int, float]] = deque(maxlen=_KEPT)

    def reset(self) -> None:
        """Forget the target."""
        self._looks.clear()

    def keeps(self, height: float, distance: float, stamp: int) -> bool:
        """Take in a look at the target's middle, `height` metres above home; tell whether it stays.

        False while it goes up or down faster than anybody who walks.
        """
        self._looks.append((stamp, height))
        earlier = [look for look in self._looks if seconds(stamp - look[0]) >= _SPAN]
        if not earlier:
            return True
        then, before = earlier[-1]
        fastest = max(_FASTEST, _FASTEST_SHARE * distance)
        return abs(height - before) <= fastest * seconds(stamp - then)
