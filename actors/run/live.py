"""Sources of a flight's streams in the application's own process."""

from __future__ import annotations

import time
import warnings
from typing import Any

import ray
from ray.exceptions import RayError

from aerodaas.actors.streams import (
    Subscriber,
    UnreadableError,
    decode_message,
    shared_memory_available,
)
from aerodaas.messages.envelope import Message
from aerodaas.runtime.live import LiveSource
from aerodaas.runtime.session import Session

__all__ = ["live_source"]

_DEPTH = 4
_PAUSE = 0.02
"""Seconds between two requests to a publisher."""
_ANSWER = 0.2
"""Least timeout of a request in seconds."""


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


def live_source(
    session: Session,
    stream: str,
    publisher: Any,  # noqa: ANN401 - Ray's handle
    node: str,
) -> LiveSource:
    """Open a source of one stream.

    Args:
        session: The run.
        stream: Name of the stream.
        publisher: Handle of the actor that publishes it.
        node: Id of that actor's Ray node.
    """
    here = ray.get_runtime_context().get_node_id()
    if here == node and shared_memory_available():
        return Subscriber(session.scope(here), {stream: _DEPTH})
    asking = _Asking(publisher, stream)
    asking.receive(0.0)
    return asking
