"""Publishing beside a loop: another thread encodes and sends."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from functools import partial

__all__ = ["BackgroundPublisher"]

_log = logging.getLogger(__name__)
_MOST_WAITING = 512
"""Messages, some seconds' worth, beyond which the newest are dropped: a loop never waits."""
_CLOSING = 2.0
"""Seconds for waiting work at the end."""


class BackgroundPublisher:
    """Does one thread's work, in order, in another one; at once before `start`."""

    def __init__(self, on_drop: Callable[[int], None] = lambda _: None) -> None:
        """Publish in the caller's own thread, as lockstep needs it.

        `on_drop` is called in the thread that publishes, once it has caught up with what was
        dropped, with the number of messages dropped since the last time.
        """
        self.dropped = 0
        """Messages that gave way because too many waited."""
        self._on_drop = on_drop
        self._told = 0
        self._waiting: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Publish in a thread of its own from now on."""
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)
        self._thread.start()

    def do(self, work: Callable[[], object]) -> None:
        """Do `work` in the background; its errors there become warnings."""
        if self._thread is None:
            work()
        elif self._waiting.qsize() < _MOST_WAITING:
            self._waiting.put(work)
        else:
            self.dropped += 1

    def close(self) -> None:
        """Finish the waiting work; later work is done at once again."""
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
    except Exception as error:  # noqa: BLE001 - one message's failure, not the others'
        _log.warning("a message was not published: %s: %s", type(error).__name__, error)
