"""Times of a recording whose clock was set while it ran, as if it had not been."""

from __future__ import annotations

from aerodaas.clock import NANOSECONDS

__all__ = ["SteadyClock"]

_BACK = 10 * NANOSECONDS
"""By how much a message may be older than the one before on its topic: it came late."""
_PAUSE = 3600 * NANOSECONDS
"""How long a topic may be silent; what is longer is a clock that was set, as by NTP at last."""


class SteadyClock:
    """Takes the leaps out of messages' times, given in the order in which they were written."""

    def __init__(self, shift: int = 0) -> None:
        """Add `shift` nanoseconds to the times before the first leap."""
        self.shift = shift
        """Nanoseconds that are added at present."""
        self.leaps = 0
        """How often the clock has leapt."""
        self._last: dict[str, int] = {}
        """Time of each topic's last message."""
        self._newest: int | None = None
        self._step = 0
        """Nanoseconds between the newest message and the one before."""

    def steady(self, time: int, topic: str = "") -> int:
        """Return the time of the next message without leaps.

        Args:
            time: By the recording's clock, nanoseconds.
            topic: Whose message it is: topics may be written one after the other.
        """
        found = time + self.shift
        last, newest = self._last.get(topic), self._newest
        if last is not None and newest is not None and not -_BACK < found - last < _PAUSE:
            self.leaps += 1
            self.shift += newest + self._step - found
            found = newest + self._step
        elif newest is not None and found > newest:
            self._step = found - newest
        self._last[topic] = found
        self._newest = found if newest is None else max(found, newest)
        return found
