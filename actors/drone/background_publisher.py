"""Background publisher of a loop: another thread encodes and sends its messages."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from functools import partial

__all__ = ["BackgroundPublisher"]

_log = logging.getLogger(__name__)
_MOST_WAITING = 512
"""Queue length (some seconds' messages) at which new ones are dropped: a loop never waits."""
_CLOSING = 2.0
"""Seconds to finish the queue at the end."""


class BackgroundPublisher:
    """Queue of work for a thread of its own, done in order; before `start` done at once."""

    def __init__(self, on_drop: Callable[[int], None] = lambda _: None) -> None:
        """Publish in the caller's own thread until `start`.

        `on_drop` is called in the publishing thread, once its queue is empty after drops, with
        the number of messages dropped since the last call.
        """
        self.dropped = 0
        """Number of messages dropped because the queue was full."""
        self._on_drop = on_drop
        self._told = 0
        self._waiting: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Publish in a thread of its own from now on."""
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)
        self._thread.start()

    def do(self, work: Callable[[], object]) -> None:
        """Queue `work`; exceptions in the publishing thread become warnings."""
        if self._thread is None:
            work()
        elif self._waiting.qsize() < _MOST_WAITING:
            self._waiting.put(work)
        else:
            self.dropped += 1

    def close(self) -> None:
        """Finish the queue; later work is done at once in the caller's thread."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._waiting.put(None)
            thread.join(_CLOSING)

    def _run(self) -> None:
        while (work := self._waiting.get()) is not None:
            _tried(work)
            if self.dropped > self._told and self._waiting.empty():
                since, self._told = self.dropped - self._told, self.dropped
                _tried(partial(self._on_drop, since))


def _tried(work: Callable[[], object]) -> None:
    try:
        work()
    except Exception as error:  # noqa: BLE001 - a failed message must not affect the others
        _log.warning("a message was not published: %s: %s", type(error).__name__, error)
