"""Subscriber of all the streams that an actor reads."""

from __future__ import annotations

import threading
import warnings
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from aerodaas.actors.streams.availability import shared_memory_available
from aerodaas.actors.streams.codec import UnreadableError, decode
from aerodaas.actors.streams.local_subscriber import LocalSubscriber
from aerodaas.messages.envelope import Message

__all__ = ["Subscriber"]


class Subscriber:
    """Subscriber of several streams for one thread; other threads may `deliver` and `wake`.

    Each stream keeps its newest `depth` messages. Messages overwritten unread leave a gap in
    `seq` and are counted in `dropped`.
    """

    def __init__(
        self,
        scope: str,
        depths: Mapping[str, int],
        unreadable: Callable[[str], None] = warnings.warn,
        within: Collection[str] = (),
    ) -> None:
        """Subscribe to streams.

        Args:
            scope: Prefix of the streams' names on this node.
            depths: Queue depth of each stream.
            unreadable: Called in any thread with the reason why an item cannot be rebuilt here; its
                message is received empty.
            within: Streams that this process publishes itself, of which it is given the messages
                by `accept`.
        """
        self._unreadable = unreadable
        self.received: dict[str, int] = dict.fromkeys(depths, 0)
        self.dropped: dict[str, int] = dict.fromkeys(depths, 0)
        self._next: dict[str, int] = {}
        self._delivered = {
            stream: deque[Message[Any]](maxlen=depth) for stream, depth in depths.items()
        }
        self._called = threading.Condition()
        self._calls = 0
        self._local = LocalSubscriber(scope) if shared_memory_available() else None
        if self._local is not None:
            for stream, depth in depths.items():
                if stream not in within:
                    self._local.subscribe(stream, depth)

    @property
    def shared(self) -> bool:
        """True if this subscriber reads shared memory."""
        return self._local is not None

    def receive(self, timeout: float) -> list[Message[Any]]:
        """Return new messages, in order within each stream; wait up to `timeout` seconds.

        Returns early, perhaps without messages, when woken. Streams are in the order of
        subscription, independent of the order of arrival.
        """
        if self._local is not None:
            return self._collect(self._local.receive(timeout))
        messages = self._collect({})
        if not messages and timeout > 0:
            self._await_call(timeout)
            messages = self._collect({})
        return messages

    def deliver(self, stream: str, data: bytes) -> None:
        """Add a message from another node.

        Args:
            stream: Name of the stream.
            data: The encoded message.
        """
        message = self._decoded(memoryview(data))
        with self._called:
            self._delivered[stream].append(message)
        self.wake()

    def accept(self, message: Message[Any]) -> None:
        """Add a message of this process."""
        with self._called:
            self._delivered[message.stream].append(message)
        self.wake()

    def wake(self) -> None:
        """Make a waiting `receive` return."""
        with self._called:
            self._calls += 1
            self._called.notify_all()
        if self._local is not None:
            self._local.wake()

    def close(self) -> None:
        """Close all streams."""
        if self._local is not None:
            self._local.close()

    def _await_call(self, timeout: float) -> None:
        with self._called:
            calls = self._calls
            self._called.wait_for(
                lambda: self._calls != calls or any(self._delivered.values()), timeout
            )

    def _collect(self, arrived: Mapping[str, Iterable[memoryview]]) -> list[Message[Any]]:
        messages: list[Message[Any]] = []
        for stream, delivered in self._delivered.items():
            start = len(messages)
            messages += map(self._decoded, arrived.get(stream, ()))
            while delivered:
                messages.append(delivered.popleft())
            for message in messages[start:]:
                self._count(message)
        return messages

    def _decoded(self, data: memoryview) -> Message[Any]:
        try:
            return decode(data)
        except UnreadableError as error:
            self._unreadable(str(error))
            return error.message

    def _count(self, message: Message[Any]) -> None:
        stream = message.stream
        missing = message.seq - self._next.get(stream, message.seq)
        self.dropped[stream] += max(0, missing)
        self.received[stream] += 1
        self._next[stream] = message.seq + 1
