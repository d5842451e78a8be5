"""The envelope in which streams carry a message, with the times of its way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from aerodaas.messages.frames import Header

__all__ = ["Message", "TraceSpan"]


E = TypeVar("E")


class TraceSpan(NamedTuple):
    """One node's share in a message's way, in nanoseconds of `clock.host_time_ns`."""

    node: str
    received: int
    published: int


@dataclass(frozen=True, slots=True)
class Message(Generic[E]):
    """The envelope that streams carry."""

    stream: str
    seq: int
    """Counts the messages of this stream; a gap seen by a reader is a drop."""
    stamp: int
    """Mission clock when published, nanoseconds."""
    header: Header
    """The measurement that this was made from."""
    captured: int
    """`clock.host_time_ns` at that measurement's capture."""
    spans: tuple[TraceSpan, ...]
    item: E | None
    """The item; None if it was processed without a result."""

    @property
    def latency_ns(self) -> int:
        """Nanoseconds from capture to the last node's publishing."""
        return (self.spans[-1].published - self.captured) if self.spans else 0
