"""The way to another node: one ObjectRef per message, a few under way, the newest kept back.

A link that is busy neither queues nor forgets the latest word: while deliveries are under way,
one message waits for each reader, and a newer one takes its place.
"""

from __future__ import annotations

import threading
from typing import Any

import ray

from aerodaas.actors.streams._codec import Encoded

__all__ = ["RemoteReader", "send_to"]

UNDER_WAY = 2
"""Deliveries not yet acknowledged beyond which a slow link keeps the newest message only."""


class _Parcel:
    """A message on its way, put into the object store once for all who read it."""

    def __init__(self, stream: str, data: bytes) -> None:
        self.stream = stream
        self._data = data
        self._reference: ray.ObjectRef[bytes] | None = None

    def reference(self) -> ray.ObjectRef[bytes]:
        # Two threads may both put it; that costs a copy and harms nobody.
        if self._reference is None:
            self._reference = ray.put(self._data)
        return self._reference


class RemoteReader:
    """An actor on another node that reads a stream."""

    def __init__(self, actor: Any, under_way: int = UNDER_WAY) -> None:  # noqa: ANN401
        """Deliver to `actor`, a Ray actor handle with a method `deliver(stream, data)`.

        At most `under_way` deliveries are not yet acknowledged at any time.
        """
        self._actor = actor
        self._limit = under_way
        # Ray may call back from its own thread, or at once from the sending one.
        self._lock = threading.RLock()
        self._under_way = 0
        self._waiting: _Parcel | None = None
        self.skipped = 0
        """Messages that gave way to newer ones while the link was busy."""

    def send(self, parcel: _Parcel) -> None:
        """Deliver a message, now or as soon as the link is free."""
        with self._lock:
            if self._under_way < self._limit:
                self._under_way += 1
                self._deliver(parcel)
            else:
                self.skipped += self._waiting is not None
                self._waiting = parcel

    def _deliver(self, parcel: _Parcel) -> None:
        done = self._actor.deliver.remote(parcel.stream, parcel.reference())
        done.future().add_done_callback(self._delivered)

    def _delivered(self, _: object) -> None:
        """A reader that has died counts as one that is done: the publisher goes on."""
        with self._lock:
            parcel, self._waiting = self._waiting, None
            if parcel is None:
                self._under_way -= 1
            else:
                self._deliver(parcel)


def send_to(readers: list[RemoteReader], stream: str, encoded: Encoded) -> None:
    """Send a message to every reader; its arrays are copied, for they may change soon."""
    parcel = _Parcel(stream, encoded.to_bytes())
    for reader in readers:
        reader.send(parcel)
