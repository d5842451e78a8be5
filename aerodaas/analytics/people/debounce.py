"""Debouncing of detections: an event begins only once enough frames agree."""

from __future__ import annotations

from collections import deque

from aerodaas.clock import seconds
from aerodaas.errors import ConfigError

__all__ = ["Debounce"]

_LONGEST_GAP = 5.0
"""Seconds without a frame after which earlier frames are discarded."""


class Debounce:
    """An event that begins when `needed` of the last `of` frames show it, for `hold` seconds.

    It ends when none of the last `of` frames shows it, so that it is reported once.
    """

    def __init__(self, needed: int = 3, of: int = 5, hold: float = 0.0) -> None:
        """Start inactive; raises ConfigError for counts and times out of range."""
        if not 1 <= needed <= of:
            raise ConfigError(f"needed must lie between 1 and of={of} frames, not {needed}")
        if not 0.0 <= hold < float("inf"):
            raise ConfigError(f"hold must be 0 s or more, not {hold}")
        self.needed = needed
        self.hold = hold
        self.active = False
        self.began = False
        """Whether the event began with the last frame."""
        self._frames: deque[tuple[int, bool]] = deque(maxlen=of)
        self._since: int | None = None

    def update(self, stamp: int, shown: bool) -> bool:  # noqa: FBT001 - its only input
        """Add a frame.

        Args:
            stamp: Mission time of the frame, nanoseconds.
            shown: Whether the frame shows the event.

        Returns:
            Whether the event holds, as `active`.
        """
        if self._frames and not 0 <= seconds(stamp - self._frames[-1][0]) <= _LONGEST_GAP:
            self._frames.clear()
        self._frames.append((stamp, shown))
        seen = [at for at, showed in self._frames if showed]
        if len(seen) < self.needed:
            self._since = None
        elif self._since is None:
            self._since = seen[0]
        before = self.active
        if self._since is not None and seconds(stamp - self._since) >= self.hold:
            self.active = True
        elif not seen:
            self.active = False
        self.began = self.active and not before
        return self.active
