"""A host for a node that a test steps by hand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.readings import Alert
from aerodaas.runtime.node import Host, Outlet

__all__ = ["Hand", "item_of", "published"]


class Hand(Host):
    """Keeps the alerts of a node; mission time is what the test sets."""

    def __init__(self) -> None:
        """Start at mission time zero."""
        self.time = 0
        self.alerts: list[Alert] = []
        self.wakes = 0

    def now(self) -> int:
        """Mission time, nanoseconds."""
        return self.time

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str
    ) -> None:
        """Keep an alert."""
        header = Header(len(self.alerts), stamp, source)
        self.alerts.append(Alert(header, kind, text, dict(values)))

    def wake(self) -> None:
        """Count the calls."""
        self.wakes += 1


def published(stream: str, item: Any, stamp: int, seq: int = 0) -> Message[Any]:  # noqa: ANN401
    """A message of a measurement at mission time `stamp`."""
    outlet = Outlet(stream)
    outlet.sent = seq
    return outlet.measure(item, Header(seq, stamp, stream), 0)


def item_of(message: Message[Any]) -> Any:  # noqa: ANN401 - of any stream
    """The item of a message that has one."""
    assert message.item is not None
    return message.item
