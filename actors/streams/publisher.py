"""Publisher of a stream."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from aerodaas.actors.streams.availability import shared_memory_available
from aerodaas.actors.streams.codec import Encoded, UnsendableError
from aerodaas.actors.streams.local_publisher import LocalPublisher
from aerodaas.actors.streams.remote import RemoteReader, send_to
from aerodaas.messages.envelope import Message

__all__ = ["Publisher", "RemoteReader"]

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
        self.remote: list[RemoteReader] = []
        self._local = LocalPublisher(scope, stream) if shared_memory_available() else None
        self._sent = 0
        self._kept: deque[tuple[int, bytes]] | None = None

    def publish(self, message: Message[Any]) -> Message[Any]:
        """Send a message to all readers; returns it as it was sent, perhaps without its item.

        Without a reader in another process, nothing is encoded.
        """
        self._sent = message.seq + 1
        outgoing = _Outgoing(message)
        if self._local is not None:
            self._local.send(outgoing.encode)
        if self.remote:
            send_to(self.remote, self.stream, outgoing.encode())
        if self._kept is not None:
            self._kept.append((message.seq, outgoing.encode().to_bytes()))
        if outgoing.problem:
            self._unsendable(outgoing.problem)
        return outgoing.message

    def since(self, seq: int) -> list[bytes]:
        """Encoded newest messages from number `seq` on; thread-safe.

        They are kept from the first call on. A reader with a `seq` ahead of this publisher has
        read its predecessor, and gets all of them.
        """
        if self._kept is None:
            self._kept = deque(maxlen=_MESSAGES_KEPT)
        first = seq if seq <= self._sent else 0
        return [data for number, data in list(self._kept) if number >= first]

    def close(self) -> None:
        """Close the stream."""
        if self._local is not None:
            self._local.close()


class _Outgoing:
    """A message that is encoded once, when the first reader needs it."""

    def __init__(self, message: Message[Any]) -> None:
        self.message = message
        self.problem = ""
        """Why the item cannot be sent; empty if it can."""
        self._encoded: Encoded | None = None

    def encode(self) -> Encoded:
        if self._encoded is None:
            try:
                self._encoded = Encoded(self.message)
            except UnsendableError as error:
                self.problem = str(error)
                self.message = replace(self.message, item=None)
                self._encoded = Encoded(self.message)
        return self._encoded
