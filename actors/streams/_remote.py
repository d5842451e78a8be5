"""The way to another node: one ObjectRef per message, at most a few under way to each reader."""

from __future__ import annotations

from typing import Any

import ray

from aerodaas.actors.streams._codec import Encoded

__all__ = ["RemoteReader", "send_to"]

_UNDER_WAY = 2
"""Deliveries not yet acknowledged beyond which a slow link drops instead of queueing."""


class RemoteReader:
    """An actor on another node that reads a stream."""

    def __init__(self, actor: Any) -> None:  # noqa: ANN401 - a Ray actor handle
        """Deliver to `actor`, which has a method `deliver(stream, data)`."""
        self._actor = actor
        self._under_way: list[ray.ObjectRef[None]] = []
        self.skipped = 0
        """Messages that were not sent because the link was still busy with earlier ones."""

    def busy(self) -> bool:
        """Tell whether the link still carries as much as it may."""
        if self._under_way:
            _, self._under_way = ray.wait(
                self._under_way, num_returns=len(self._under_way), timeout=0
            )
        return len(self._under_way) >= _UNDER_WAY

    def deliver(self, stream: str, reference: ray.ObjectRef[bytes]) -> None:
        """Send a message that is in the object store."""
        self._under_way.append(self._actor.deliver.remote(stream, reference))


def send_to(readers: list[RemoteReader], stream: str, encoded: Encoded) -> None:
    """Put a message into the object store once and send it to every reader that is free."""
    free = []
    for reader in readers:
        if reader.busy():
            reader.skipped += 1
        else:
            free.append(reader)
    if not free:
        return
    reference = ray.put(encoded.to_bytes())
    for reader in free:
        reader.deliver(stream, reference)
