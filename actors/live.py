"""Streams of a flight, read in the application's own process."""

from __future__ import annotations

import time
import uuid
from collections import deque
from collections.abc import Callable
from typing import Any

import ray

from aerodaas.actors.session import Session
from aerodaas.actors.streams import Inbox

__all__ = ["LiveReader"]

_DEPTH = 4


class LiveReader:
    """Reads the items of one stream until the flight is over; keeps the newest few."""

    def __init__(self, session: Session, stream: str, over: Callable[[], bool]) -> None:
        """Read `stream` of the run `session`; `over` tells when to stop waiting."""
        scope = session.scope(ray.get_runtime_context().get_node_id())
        self._inbox = Inbox(scope, f"application/{uuid.uuid4().hex[:8]}", {stream: _DEPTH})
        self._waiting: deque[Any] = deque()
        self._newest: Any = None
        self._over = over

    def next(self, timeout: float | None) -> Any:  # noqa: ANN401 - the stream's item
        """Return the next item that says something.

        Raises TimeoutError after `timeout` seconds, StopIteration once the flight is over.
        """
        until = time.monotonic() + (float("inf") if timeout is None else timeout)
        while not self._waiting:
            over = self._over()
            self._take(min(0.2, max(0.0, until - time.monotonic())))
            if not self._waiting and over:
                raise StopIteration
            if not self._waiting and time.monotonic() >= until:
                raise TimeoutError(f"nothing arrived within {timeout} s")
        return self._waiting.popleft()

    def newest(self, timeout: float | None) -> Any:  # noqa: ANN401 - the stream's item
        """Return the newest item, again if there is none newer; raises as `next` before any."""
        self._take(0.0)
        if self._newest is None:
            self.next(timeout)
        self._waiting.clear()
        return self._newest

    def _take(self, timeout: float) -> None:
        items = [message.item for message in self._inbox.receive(timeout)]
        for item in items:
            if item is not None:
                self._waiting.append(item)
                self._newest = item
