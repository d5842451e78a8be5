"""Transport to other nodes: a few messages in transit, and the newest one waiting.

An argument arrives with its call, up to Ray's RAY_max_direct_call_object_size; one in the object
store costs its reader four or five round trips more. So a message for one reader is sent in the
call, and one for several, which may share a node and a link, is put into the store.

A busy link neither queues messages nor loses the latest one: while deliveries are in transit, one
message waits for each reader, and a newer one replaces it.
"""

from __future__ import annotations

import threading
from typing import Any

import ray

from aerodaas.actors.streams.codec import Encoded

__all__ = ["RemoteReader", "send_to"]

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


def send_to(readers: list[RemoteReader], stream: str, encoded: Encoded) -> None:
    """Send a message to every reader; its arrays are copied, because they may change soon.

    Args:
        readers: The readers.
        stream: Name of the stream.
        encoded: The message.
    """
    transfer = _Transfer(stream, encoded.to_bytes(), shared=len(readers) > 1)
    for reader in readers:
        reader.send(transfer)
