"""When the next task of a periodic stream is due: video makes arrivals predictable."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass

from aerodaas.schedulers.analytics.base import MILLISECOND

__all__ = ["LATENESS", "Forecast"]

LATENESS = 20 * MILLISECOND
"""An arrival this much after its time is given up."""
_TOLERANCE = 0.02
"""Relative difference between two gaps that still counts as regular."""
_REGULAR = 2
"""Regular gaps in a row before a stream is believed."""


@dataclass(slots=True)
class _Stream:
    last: int
    period: int = 0
    regular: int = 0


class Forecast:
    """The streams of one model, each with the time and gap of its last arrival."""

    def __init__(self) -> None:
        # Streams of one period keep their order of arrival, so the first is due first.
        self._streams: OrderedDict[str, _Stream] = OrderedDict()

    def arrived(self, source: str, now: int) -> bool:
        """Take note of an arrival; True if it had been forecast.

        Args:
            source: The drone or stream whose task has arrived.
            now: Time of the event, nanoseconds.
        """
        stream = self._streams.get(source)
        if stream is None:
            self._streams[source] = _Stream(now)
            return False
        gap = now - stream.last
        expected = stream.regular >= _REGULAR
        regular = abs(gap - stream.period) <= _TOLERANCE * gap
        stream.regular = stream.regular + 1 if regular else 0
        stream.last, stream.period = now, gap
        self._streams.move_to_end(source)
        return expected and regular

    def due(self, now: int, until: int) -> Iterator[tuple[int, str]]:
        """Times and sources of the arrivals expected, the next period's only.

        Args:
            now: Present time, nanoseconds; arrivals that are overdue are given as of now.
            until: End of the forecast, nanoseconds; arrivals lie before it.
        """
        given_up = now - LATENESS
        for source, stream in self._streams.items():
            at = stream.last + stream.period
            if at >= until:
                return
            if stream.regular >= _REGULAR and at > given_up:
                yield (max(now, at)), source
