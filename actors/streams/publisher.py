"""Publisher of a stream, in shared memory and to other nodes.

To other nodes a few messages are in transit, and the newest one waits. An argument arrives with its
call, up to Ray's RAY_max_direct_call_object_size; one in the object store costs its reader four or
five round trips more. So a message for one reader is sent in the call, and one for several, which
may share a node and a link, is put into the store.
"""

from __future__ import annotations

import threading
import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import ray

from aerodaas.actors.streams.availability import shared_memory_available
from aerodaas.actors.streams.codec import Encoded, UnsendableError
from aerodaas.actors.streams.local_publisher import LocalPublisher
from aerodaas.messages.envelope import Message

__all__ = ["Publisher", "RemoteReader"]

_MESSAGES_KEPT = 4


UNDER_WAY = 2
"""Unacknowledged deliveries beyond which a slow link keeps the newest message only."""


class _Transfer:
    """A message to deliver, put into the object store once if it has several readers."""

    def __init__(self, stream: str, data: bytes, *, shared: bool) -> None:
        self.stream = stream
        self._data = data
        self._shared = shared
        self._reference: ray.ObjectRef[bytes] | None = None

    def content(self) -> bytes | ray.ObjectRef[bytes]:
        """Argument of the delivering call."""
        if not self._shared:
            return self._data
        # Two threads may both put it; that costs a copy only.
        if self._reference is None:
            self._reference = ray.put(self._data)
        return self._reference


class RemoteReader:
    """An actor on another node that reads a stream."""

    def __init__(self, actor: Any, under_way: int = UNDER_WAY) -> None:  # noqa: ANN401
        """Deliver to `actor`, a Ray actor handle with a method `deliver(stream, data)`.

        At most `under_way` deliveries are unacknowledged at any time.
        """
        self._actor = actor
        self._limit = under_way
        # Ray may call back from its own thread, or at once from the sending one.
        self._lock = threading.RLock()
        self._under_way = 0
        self._waiting: _Transfer | None = None
        self.skipped = 0
        """Number of messages replaced by newer ones while the link was busy."""

    def send(self, transfer: _Transfer) -> None:
        """Deliver a message, now or as soon as the link is free."""
        with self._lock:
            if self._under_way < self._limit:
                self._under_way += 1
                self._deliver(transfer)
            else:
                self.skipped += self._waiting is not None
                self._waiting = transfer

    def _deliver(self, transfer: _Transfer) -> None:
        done = self._actor.deliver.remote(transfer.stream, transfer.content())
        done.future().add_done_callback(self._delivered)

    def _delivered(self, _: object) -> None:
        """Send the waiting message after a delivery; a failed one counts, too."""
        with self._lock:
            transfer, self._waiting = self._waiting, None
            if transfer is None:
                self._under_way -= 1
            else:
                self._deliver(transfer)


def _send_to(readers: list[RemoteReader], stream: str, encoded: Encoded) -> None:
    """Send a message to every reader; its arrays are copied, because they may change soon."""
    transfer = _Transfer(stream, encoded.to_bytes(), shared=len(readers) > 1)
    for reader in readers:
        reader.send(transfer)


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
            _send_to(self.remote, self.stream, outgoing.encode())
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
