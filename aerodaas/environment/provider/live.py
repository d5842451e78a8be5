"""One live connection to a mission: its state as it changes, and items of its streams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from aerodaas.environment.provider.exchange import printed
from aerodaas.environment.provider.wire import WireConnection
from aerodaas.protocol.schemas import MissionOut

__all__ = ["LiveConnection", "ReceivedItem"]

_SILENT_SECONDS = 15.0
"""Seconds without a message after which the connection is lost; a service sends one a second."""


@dataclass(frozen=True)
class ReceivedItem:
    """An item of a stream as it arrived."""

    stream: str
    seq: int
    """Counts the messages of the stream; a gap is a drop."""
    content: Any
    """For `wire_items.unpack`."""
    blob: bytes
    left_out: str = ""
    """Why it is not there; empty for one that is."""


class LiveConnection(WireConnection):
    """Connection to a mission; iterate over it until the mission is over.

    Yields the mission at each change, and items. Raises SourceError when the connection is lost,
    MissionError for messages that are not as agreed.
    """

    def __iter__(self) -> Iterator[MissionOut | ReceivedItem]:
        """Yield what arrives until the mission is over."""
        while True:
            message, blob = self.receive(_SILENT_SECONDS)
            kind = message.get("kind")
            if kind == "end":
                return
            if kind == "mission":
                yield self._mission(message)
            elif kind in {"item", "left_out"}:
                yield self._item(message, blob)

    def _mission(self, message: dict[str, Any]) -> MissionOut:
        try:
            return MissionOut.model_validate(printed(message.get("mission")), extra="ignore")
        except ValidationError as error:
            place = ".".join(map(str, error.errors()[0]["loc"]))
            raise self.exchange.strange(f"the mission's {place}") from None

    def _item(self, message: dict[str, Any], blob: bytes) -> ReceivedItem:
        stream, seq = message.get("stream"), message.get("seq")
        if not isinstance(stream, str) or not isinstance(seq, int):
            raise self.exchange.strange("an item without its stream or number")
        left_out = ""
        if message["kind"] == "left_out":
            left_out = str(printed(message.get("reason"))) or "the provider does not say why"
        return ReceivedItem(stream, seq, message.get("item"), blob, left_out)
