"""Reader of a flight's stream in the application's own process."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from aerodaas.messages.envelope import Message

__all__ = ["LiveReader", "LiveSource"]

_WAITING = 256
"""Most messages that wait for a slow reader; the oldest ones go first."""


class LiveSource(Protocol):
    """Where a reader's messages come from."""

    def receive(self, timeout: float) -> list[Message[Any]]:
        """Return new messages; wait up to `timeout` seconds for them."""
        ...


class LiveReader:
    """Reader of one stream's items until the flight is over; buffers the newest few."""

    def __init__(self, source: LiveSource, over: Callable[[], bool]) -> None:
        """Read from `source`; `over` returns whether the flight is over."""
        self._source = source
        self._waiting: deque[Message[Any]] = deque(maxlen=_WAITING)
        self._newest: Any = None
        self._over = over

    def next(self, timeout: float | None) -> Any:  # noqa: ANN401 - the stream's item
        """Return the next item, skipping empty messages; raises as `next_message` does."""
        return self.next_message(timeout).item

    def next_message(self, timeout: float | None) -> Message[Any]:
        """Return the next message that has an item.

        Raises TimeoutError after `timeout` seconds, StopIteration once the flight is over.
        """
        until = time.monotonic() + (float("inf") if timeout is None else timeout)
        while not self._waiting:
            over = self._over()
            self._read(min(0.2, max(0.0, until - time.monotonic())))
            late = time.monotonic() >= until
            # Whether a mission that has just ended is known to be over must not decide.
            if not self._waiting and (over or (late and self._over())):
                raise StopIteration
            if not self._waiting and late:
                raise TimeoutError(f"nothing arrived within {timeout} s")
        return self._waiting.popleft()

    def latest_message(self, timeout: float | None) -> Message[Any]:
        """Return the newest message that has not been returned; raises as `next_message` does."""
        message = self.next_message(timeout)
        self._read(0.0)
        if self._waiting:
            message = self._waiting[-1]
            self._waiting.clear()
        return message

    def newest(self, timeout: float | None) -> Any:  # noqa: ANN401 - the stream's item
        """Return the newest item, again if there is none newer; raises like `next` without one."""
        self._read(0.0)
        if self._newest is None:
            self.next(timeout)
        self._waiting.clear()
        return self._newest

    def _read(self, timeout: float) -> None:
        for message in self._source.receive(timeout):
            if message.item is not None:
                self._waiting.append(message)
                self._newest = message.item
