"""A reader of streams in a process of its own, driven by the tests."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from aerodaas.actors.streams import Subscriber
from aerodaas.messages.frames import Frame

__all__ = ["Reader", "Seen", "digest"]


def digest(item: object) -> str:
    """A short name for an item's content."""
    content = item.image.tobytes() if isinstance(item, Frame) else repr(item).encode()
    return hashlib.sha256(content).hexdigest()[:16]


@dataclass(frozen=True)
class Seen:
    """What a reader saw of one message."""

    seq: int
    stamp: int
    captured: int
    digest: str


class Reader:
    """One subscriber by stream; also takes what comes from other nodes."""

    def __init__(self) -> None:
        """Read nothing yet."""
        self._subscribers: dict[str, Subscriber] = {}

    def open(self, scope: str, stream: str, depth: int) -> None:
        """Join a stream."""
        self._subscribers[stream] = Subscriber(scope, {stream: depth})

    def deliver(self, stream: str, data: bytes) -> None:
        """Take a message from another node."""
        self._subscribers[stream].deliver(stream, data)

    def take(self, stream: str, timeout: float = 0.0) -> list[Seen]:
        """What has arrived since the last call."""
        messages = self._subscribers[stream].receive(timeout)
        return [Seen(m.seq, m.stamp, m.captured, digest(m.item)) for m in messages]

    def counts(self, stream: str) -> tuple[int, int]:
        """Messages received and dropped."""
        subscriber = self._subscribers[stream]
        return subscriber.received[stream], subscriber.dropped[stream]
