"""Dispatch on an item's type, shared helpers, and the fallback for unknown types."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, singledispatch
from typing import Any, Protocol

from foxglove import Schema
from foxglove.messages import Quaternion, Timestamp, Vector3

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import RecordingConfig
from aerodaas.geometry.frames import GeodeticOrigin, Vector
from aerodaas.messages.envelope import Message
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.recording.converters.h264 import H264Encoder
from aerodaas.recording.encoding import Entry, plain
from aerodaas.recording.messages import ItemRecord, channel_of, json_entry
from aerodaas.recording.reference_frames import Rotation

__all__ = [
    "FoxgloveMessage",
    "Session",
    "convert",
    "foxglove_entry",
    "quaternion",
    "robot_of",
    "vector",
]


@dataclass(slots=True)
class Session:
    """State of a recording that its converters share."""

    config: RecordingConfig
    epoch_ns: int
    """Unix time at mission time zero."""
    home: GeodeticOrigin | None = None
    """Geodetic origin of the local reference frame, for maps."""
    last: dict[tuple[str, str], Any] = field(default_factory=dict)
    """Last value by converter and stream, so that only changes are written."""
    videos: dict[str, H264Encoder] = field(default_factory=dict)
    """Video encoders by stream, if images are recorded as video."""

    def time(self, stamp: int) -> Timestamp:
        """Foxglove's timestamp of a mission time."""
        return Timestamp(*divmod(self.epoch_ns + stamp, NANOSECONDS))

    def changed(self, kind: str, stream: str, value: object) -> bool:
        """Whether a value differs from that of the last call for its kind and stream.

        Args:
            kind: Kind of value.
            stream: Stream that it belongs to.
            value: The value.
        """
        key = (kind, stream)
        if key in self.last and self.last[key] == value:
            return False
        self.last[key] = value
        return True


class FoxgloveMessage(Protocol):
    """A message of Foxglove's schemas."""

    def encode(self) -> bytes:
        """The message as protobuf."""
        ...


def foxglove_entry(topic: str, message: FoxgloveMessage, stamp: int) -> Entry:
    """A message of Foxglove's schemas for its channel.

    Args:
        topic: The channel's.
        message: The message.
        stamp: Mission time of the described measurement, nanoseconds.
    """
    return Entry(topic, _schema_of(type(message)), message.encode(), stamp)


@cache
def _schema_of(kind: Any) -> Schema:  # noqa: ANN401 - a class of Foxglove's
    schema: Schema = kind.get_schema()
    return schema


@singledispatch
def convert(item: object, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Yield the entries of an item: by default its JSON.

    Args:
        item: Item of any class.
        message: Message that brought it.
        session: State of the recording.
    """
    del session
    channel, header = channel_of(type(item)), message.header
    if channel is None:
        opaque = isinstance(item, OpaqueItem)
        kind = item.kind if opaque else type(item).__name__
        value = plain(item.value if opaque else item)
        yield json_entry(ItemRecord(header, kind, value), message.stream)
        return
    labels: dict[str, str | int] = {}
    if "robot" in channel.labels:
        labels["robot"] = robot_of(message)
    stamp = getattr(item, "stamp", None)
    if stamp is None:
        labels |= {"stamp": header.stamp, "source": header.source}
    yield json_entry(item, message.stream, stamp, **labels)


def robot_of(message: Message[Any]) -> str:
    """Id of the robot that a message comes from."""
    return (message.header.source or message.stream).partition("/")[0]


def vector(values: Vector | Sequence[float]) -> Vector3:
    """Convert a vector for Foxglove."""
    return Vector3(x=float(values[0]), y=float(values[1]), z=float(values[2]))


def quaternion(rotation: Rotation) -> Quaternion:
    """Convert a rotation for Foxglove."""
    x, y, z, w = rotation
    return Quaternion(x=x, y=y, z=z, w=w)
