"""Pause of a reader between two batches of messages, so that it takes several in one go.

That takes less of the processor: between two wakes others run, and code and data have to come into
the caches anew.
"""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["BatchPause"]

_FIRST = 0.001
_GROWTH = 1.25
"""Factor by which the pause grows from batch to batch, while no queue fills."""
_ROOM = 4
"""A batch that has more of a stream than this part of its queue divides the pause by as much."""


class BatchPause:
    """Wall seconds until the next batch: as many as leave most of each queue free."""

    def __init__(self, longest: float) -> None:
        """Begin with a millisecond; `longest` is the longest pause in seconds, 0 for none."""
        self._longest = longest
        self._pause = _FIRST

    def after(self, counts: Mapping[str, int], depths: Mapping[str, int]) -> float:
        """The pause after a batch, seconds.

        Args:
            counts: Messages of the batch, by stream.
            depths: Depth of each stream's queue.
        """
        if any(count > depths[stream] // _ROOM for stream, count in counts.items()):
            self._pause /= _ROOM
        else:
            self._pause = min(self._longest, self._pause * _GROWTH)
        return self._pause
