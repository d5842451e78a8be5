"""Items of a flight's streams as a live view sends them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np

from aerodaas.analytics.wire_items import pack
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.graph import Graph
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import AeroDaaSError, ConfigError, failure_line
from aerodaas.messages.detections import Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.protocol.schemas import PictureForm, StreamKind
from aerodaas.recording.converters.h264 import H264Encoder, is_key_frame
from aerodaas.recording.playback.page_items import (
    packed_depth,
    packed_picture,
    packed_places,
    packed_target,
)
from aerodaas.terrain.ground import Ground

__all__ = ["PackedReader", "drawn_streams", "ground_of"]

_VIDEO_QUALITY = 26
"""x264's constant rate factor of a live picture; a recording has its own."""

_DRAWN = frozenset({PictureForm.JPEG, PictureForm.H264})
"""Forms that a page asks for."""


class PackedReader:
    """Reader of one stream's items as JSON messages with a blob each."""

    def __init__(
        self,
        reader: Any,  # noqa: ANN401 - LiveReader, of Ray's side
        stream: str,
        form: PictureForm = PictureForm.WHOLE,
        ground: Ground | None = None,
    ) -> None:
        """Read `stream` by `reader`; pictures in this form, and what is in them on this ground."""
        self._reader = reader
        self._stream = stream
        self._form = form
        self._ground = ground
        self._encoder: H264Encoder | None = None

    def next_packed(self, timeout: float) -> tuple[dict[str, Any], bytes] | None:
        """The next item; None if there was none within `timeout` wall seconds.

        In the place of one that cannot be written, the message tells for what `reason`.
        """
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
        named = {"stream": self._stream, "seq": message.seq}
        try:
            found = self._formed(message.item, message.header)
        except Exception as error:  # noqa: BLE001 - a plug-in's item may raise anything
            reason = str(error) if isinstance(error, AeroDaaSError) else failure_line(error)
            return {"kind": "left_out", **named, "reason": reason}, b""
        if found is None:
            return None
        item, blob, more = found
        head = {"kind": "item", **named, **more}
        stamps = {"stamp": message.stamp, "captured": message.captured}
        return {**head, **stamps, "item": item, "blob": bool(blob)}, blob

    def _formed(self, item: object, header: Header) -> tuple[Any, bytes, dict[str, Any]] | None:
        """An item made from `header`, its blob, and further words; None for what is not drawn."""
        if isinstance(item, AeroNavigation) and self._form is not PictureForm.WHOLE:
            target = next((one.target for one in item.commands if one.target), None)
            return None if target is None else (packed_target(header, target), b"", {})
        if isinstance(item, Detections) and self._form in _DRAWN:
            return *pack(item), packed_places(item, self._ground)
        if not isinstance(item, Frame) or self._form is PictureForm.WHOLE:
            return None if self._form is PictureForm.DEPTH else (*pack(item), {})
        if self._form is PictureForm.DEPTH:
            return None if item.depth is None else (*packed_depth(item.header, item.depth), {})
        measured = item.depth is not None
        data = self._video(item) if self._form is PictureForm.H264 else b""
        if data:
            content = packed_picture(item.header, len(data), "h264", measured=measured)
            return content, data, {"key": is_key_frame(data)}
        content, data = pack(Frame(item.header, item.image))
        return packed_picture(item.header, len(data), "jpeg", measured=measured), data, {}

    def _video(self, frame: Frame) -> bytes:
        """A picture in H.264; empty where it cannot be encoded."""
        size = frame.width, frame.height
        try:
            if self._encoder is None or self._encoder.size != size:
                self._encoder = H264Encoder(*size, _VIDEO_QUALITY)
            return self._encoder.encode(frame.image, frame.header.stamp)
        except ValueError:
            return b""


def ground_of(config: EnvironmentConfig) -> Ground | None:
    """The terrain around home, where there is one; it lies on the local frame's zero there.

    None as well where it is not known at home, or of too many samples: then no drone starts, and
    its own mission says why.
    """
    home, terrain = config.home, config.terrain
    if home is None or terrain is None:
        return None
    reach = max((robot.limits.max_range for robot in config.robots), default=0.0)
    with contextlib.suppress(ConfigError):
        return Ground.of(terrain, home.origin, np.zeros(3), reach)
    return None


def drawn_streams(graph: Graph) -> dict[str, StreamKind]:
    """The streams that a page can draw, by name: pictures, what was found in them, and navigation.

    None before they can be read.
    """
    if graph.reader is None:
        return {}
    kinds = (
        (Frame, StreamKind.PICTURES),
        (Detections, StreamKind.DETECTIONS),
        (AeroNavigation, StreamKind.NAVIGATION),
    )
    return {
        node.id: kind
        for node in list(graph.nodes.values())
        for item, kind in kinds
        if issubclass(node.item, item) and not node.dormant
    }
