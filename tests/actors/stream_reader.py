"""A reader of streams in a process of its own, driven by the tests."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

from aerodaas.actors.streams import Subscriber
from aerodaas.messages.envelope import Message
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
        self._kept: dict[str, list[Message[Any]]] = {}

    def open(self, scope: str, stream: str, depth: int) -> None:
        """Join a stream."""
        self._subscribers[stream] = Subscriber(scope, {stream: depth})
        self._kept[stream] = []

    def deliver(self, stream: str, data: bytes) -> None:
        """Take a message from another node."""
        self._subscribers[stream].deliver(stream, data)

    def take(self, stream: str, timeout: float = 0.0, *, keep: bool = False) -> list[Seen]:
        """What has arrived since the last call; with `keep`, hold on to the messages."""
        messages = self._subscribers[stream].receive(timeout)
        if keep:
            self._kept[stream] += messages
        return [Seen(m.seq, m.stamp, m.captured, digest(m.item)) for m in messages]

    def kept(self, stream: str) -> list[str]:
        """What the messages held on to say by now."""
        return [digest(message.item) for message in self._kept[stream]]

    def counts(self, stream: str) -> tuple[int, int]:
        """Messages received and dropped."""
        subscriber = self._subscribers[stream]
        return subscriber.received[stream], subscriber.dropped[stream]

    def close(self, stream: str) -> list[str]:
        """Leave a stream; returns what the messages held on to say after that."""
        self._subscribers.pop(stream).close()
        return [digest(message.item) for message in self._kept.pop(stream)]
