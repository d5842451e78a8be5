"""Reader of a flight's streams in the application's own process."""

from __future__ import annotations

import time
import warnings
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import ray
from ray.exceptions import RayError

from aerodaas.actors.streams import (
    Subscriber,
    UnreadableError,
    decode_message,
    shared_memory_available,
)
from aerodaas.runtime.session import Session
from aerodaas.types.status import Message

__all__ = ["LiveReader"]

_DEPTH = 4
_WAITING = 256
"""Most messages that wait for a slow reader; the oldest ones go first."""
_PAUSE = 0.02
"""Seconds between two requests to a publisher."""
_ANSWER = 0.2
"""Least timeout of a request in seconds."""


class _Source(Protocol):
    def receive(self, timeout: float) -> list[Message[Any]]:
        """Return new messages; wait up to `timeout` seconds for them."""
        ...


class _Asking:
    """Polls the publisher for its newest messages: actors cannot call an application."""

    def __init__(self, publisher: Any, stream: str) -> None:  # noqa: ANN401 - Ray's handle
        self._publisher = publisher
        self._stream = stream
        self._next = 0
        self._question: Any = None

    def receive(self, timeout: float) -> list[Message[Any]]:
        """Return new messages; wait up to `timeout` seconds for them."""
        until = time.monotonic() + timeout
        while True:
            messages = self._ask(max(_ANSWER, until - time.monotonic()))
            left = until - time.monotonic()
            if messages or left <= 0.0:
                return messages
            time.sleep(min(_PAUSE, left))

    def _ask(self, timeout: float) -> list[Message[Any]]:
        if self._question is None:
            self._question = self._publisher.hand_out.remote(self._stream, self._next)
        answered, _ = ray.wait([self._question], timeout=timeout)
        if not answered:
            return []
        self._question = None
        try:
            messages = [_decoded(data) for data in ray.get(answered[0])]
        except RayError:
            return []  # It has died: either it is restarted, or the flight is over.
        if messages:
            self._next = messages[-1].seq + 1
        return messages


def _decoded(data: bytes) -> Message[Any]:
    try:
        return decode_message(memoryview(data))
    except UnreadableError as error:
        warnings.warn(str(error), stacklevel=2)
        return error.message


class LiveReader:
    """Reader of one stream's items until the flight is over; buffers the newest few."""

    def __init__(
        self,
        session: Session,
        stream: str,
        publisher: Any,  # noqa: ANN401 - Ray's handle
        node: str,
        over: Callable[[], bool],
    ) -> None:
        """Read `stream` of the run `session` from its `publisher`, an actor on the node `node`.

        `over` returns whether the flight is over.
        """
        here = ray.get_runtime_context().get_node_id()
        self._source: _Source
        if here == node and shared_memory_available():
            self._source = Subscriber(session.scope(here), {stream: _DEPTH})
        else:
            self._source = _Asking(publisher, stream)
            self._source.receive(0.0)
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
            self._take(min(0.2, max(0.0, until - time.monotonic())))
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
        self._take(0.0)
        if self._waiting:
            message = self._waiting[-1]
            self._waiting.clear()
        return message

    def newest(self, timeout: float | None) -> Any:  # noqa: ANN401 - the stream's item
        """Return the newest item, again if there is none newer; raises like `next` without one."""
        self._take(0.0)
        if self._newest is None:
            self.next(timeout)
        self._waiting.clear()
        return self._newest

    def _take(self, timeout: float) -> None:
        for message in self._source.receive(timeout):
            if message.item is not None:
                self._waiting.append(message)
                self._newest = message.item
