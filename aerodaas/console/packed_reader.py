"""Items of a flight's streams as a live view sends them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from aerodaas.analytics.wire_items import pack
from aerodaas.dataflow.graph import Graph
from aerodaas.protocol.schemas import StreamKind
from aerodaas.types.data import Detections, Frame
from aerodaas.types.status import Message

__all__ = ["PackedReader", "drawn_streams"]


class PackedReader:
    """Reader of one stream's items as JSON messages with a blob each."""

    def __init__(self, reader: Any, stream: str) -> None:  # noqa: ANN401 - LiveReader, of Ray's side
        """Read `stream` by `reader`."""
        self._reader = reader
        self._stream = stream

    def next_packed(self, timeout: float) -> tuple[dict[str, Any], bytes] | None:
        """The next item; None if there was none within `timeout` wall seconds."""
        return self._packed(self._reader.next_message, timeout)

    def latest_packed(self, timeout: float) -> tuple[dict[str, Any], bytes] | None:
        """The newest item that was not returned; None if there was none within `timeout`."""
        return self._packed(self._reader.latest_message, timeout)

    def _packed(
        self, read: Callable[[float], Message[Any]], timeout: float
    ) -> tuple[dict[str, Any], bytes] | None:
        try:
            message = read(timeout)
        except (TimeoutError, StopIteration):
            return None
        item, blob = pack(message.item)
        head = {"kind": "item", "stream": self._stream, "seq": message.seq}
        stamps = {"stamp": message.stamp, "captured": message.captured}
        return {**head, **stamps, "item": item, "blob": bool(blob)}, blob


def drawn_streams(graph: Graph) -> dict[str, StreamKind]:
    """The streams that a page can draw, by name: pictures, and what was found in them.

    None before they can be read.
    """
    if graph.reader is None:
        return {}
    kinds = ((Frame, StreamKind.PICTURES), (Detections, StreamKind.DETECTIONS))
    return {
        node.id: kind
        for node in list(graph.nodes.values())
        for item, kind in kinds
        if issubclass(node.item, item) and not node.dormant
    }
