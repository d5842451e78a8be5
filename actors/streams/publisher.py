"""Publisher of a stream."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.actors.streams.availability import shared_memory_available
from aerodaas.actors.streams.codec import Encoded, UnsendableError
from aerodaas.actors.streams.local_publisher import LocalPublisher
from aerodaas.actors.streams.remote import RemoteReader, send_to
from aerodaas.cameras.base import own_memory
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Header
from aerodaas.types.status import Message, TraceSpan

__all__ = ["Publisher", "RemoteReader"]

_LATENCIES_KEPT = 256
_MESSAGES_KEPT = 4


class Publisher:
    """Publisher of one stream: in shared memory on this node, by Ray calls to other nodes.

    For an item that cannot be sent, an empty message is published, so that its readers continue.
    """

    def __init__(
        self, scope: str, stream: str, unsendable: Callable[[str], None] = warnings.warn
    ) -> None:
        """Open `stream` for writing; `scope` is the prefix of its name on this node.

        `unsendable` is called with a description of an item that cannot be sent.
        """
        self._unsendable = unsendable
        self.scope = scope
        self.stream = stream
        self.sent = 0
        self.latencies: deque[float] = deque(maxlen=_LATENCIES_KEPT)
        """Milliseconds from capture to publishing, newest last."""
        self.remote: list[RemoteReader] = []
        self._local = LocalPublisher(scope, stream) if shared_memory_available() else None
        self._kept: deque[tuple[int, bytes]] | None = None

    def measure(self, item: Any, header: Header, captured: int) -> Message[Any]:  # noqa: ANN401
        """Publish a measurement, the first message of its path; `captured` is host time in ns."""
        span = TraceSpan(self.stream, captured, host_time_ns())
        return self._send(header.stamp, header, captured, (span,), item)

    def derive(
        self,
        item: Any,  # noqa: ANN401
        origin: Message[Any],
        received: int,
        stamp: int,
    ) -> Message[Any]:
        """Publish the result of `origin`, which was received at host time `received`."""
        spans = (*origin.spans, TraceSpan(self.stream, received, host_time_ns()))
        return self._send(stamp, origin.header, origin.captured, spans, item)

    def _send(
        self,
        stamp: int,
        header: Header,
        captured: int,
        spans: tuple[TraceSpan, ...],
        item: Any,  # noqa: ANN401
    ) -> Message[Any]:
        self.latencies.append((spans[-1].published - captured) / 1e6)
        message = Message(self.stream, self.sent, stamp, header, captured, spans, item)
        self.sent += 1
        problem = ""
        try:
            encoded = Encoded(message)
        except UnsendableError as error:
            problem = str(error)
            message = replace(message, item=None)
            encoded = Encoded(message)
        if self._local is not None:
            self._local.send(encoded)
        if self.remote:
            send_to(self.remote, self.stream, encoded)
        if self._kept is not None:
            self._kept.append((message.seq, encoded.to_bytes()))
        if problem:
            self._unsendable(problem)
        return message

    def since(self, seq: int) -> list[bytes]:
        """Encoded newest messages from number `seq` on; thread-safe.

        They are kept from the first call on. A reader with a `seq` ahead of this publisher has
        read its predecessor, and gets all of them.
        """
        if self._kept is None:
            self._kept = deque(maxlen=_MESSAGES_KEPT)
        first = seq if seq <= self.sent else 0
        return [data for number, data in list(self._kept) if number >= first]

    def picture_memory(self, height: int, width: int) -> NDArray[np.uint8]:
        """Memory for the picture of the next message, where its readers will look at it.

        A `PictureMemory` of cameras: height x width x 3. It must not be written to once the message
        is published.
        """
        lent = None if self._local is None else self._local.lend(height * width * 3)
        return own_memory(height, width) if lent is None else lent.reshape(height, width, 3)

    def close(self) -> None:
        """Close the stream."""
        if self._local is not None:
            self._local.close()
