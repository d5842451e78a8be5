"""The messages of a recording: one table of classes, schemas and topics, and the JSON of each.

The JSON is that of `aerodaas.messages.serialization.schema`. Labels stand before it, such as the
robot of a state.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

from foxglove import Schema
from pydantic import Field

from aerodaas.config.model import GeofenceConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.detections import Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision, MissionPlan, MissionStatus, SetpointRecord
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.payload import Photo
from aerodaas.messages.readings import Alert
from aerodaas.messages.serialization.json_types import Int64
from aerodaas.messages.serialization.records import fast_pickle
from aerodaas.messages.serialization.schema import (
    MessageError,
    json_schema_of,
    json_text,
    message_of_text,
)
from aerodaas.messages.vehicle import VehicleState
from aerodaas.messages.vitals import Vitals
from aerodaas.messages.waypoints import NavigationType, SchedulingType, VelocityCommand, Waypoint
from aerodaas.recording.encoding import Entry, topic

__all__ = [
    "CHANNELS",
    "FORMAT",
    "NO_LABELS",
    "Channel",
    "Drops",
    "FrameInfo",
    "Hop",
    "ItemRecord",
    "Labels",
    "Latency",
    "NavigationRecord",
    "channel_of",
    "json_entry",
    "labels_and_message",
]

FORMAT = 2
"""Version of the recorded shapes; `decoding.old_shapes` has the earlier ones."""
_MILLISECOND = 1_000_000


@fast_pickle
@dataclass(frozen=True, slots=True)
class FrameInfo:
    """A frame without its pixels, which are an image or part of a video."""

    header: Header
    width: Annotated[int, Field(ge=1, le=1 << 20)]
    """Pixels across."""
    height: Annotated[int, Field(ge=1, le=1 << 20)]
    """Pixels down."""
    odometry: Odometry | None = None
    """The vehicle's odometry at capture, where known."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class NavigationRecord:
    """Navigation that analytics made from one measurement."""

    header: Header
    type: NavigationType
    scheduling: SchedulingType
    priority: Int64 | None
    waypoints: tuple[Waypoint, ...]
    commands: tuple[VelocityCommand, ...]

    @classmethod
    def of(cls, navigation: AeroNavigation, header: Header) -> NavigationRecord:
        """Navigation as it is recorded.

        Args:
            navigation: Result of an analysis.
            header: Header of the message that brought it.
        """
        return cls(
            header,
            navigation.navigation_type,
            navigation.scheduling_type,
            navigation.priority,
            tuple(navigation.waypoints),
            tuple(navigation.commands),
        )


@fast_pickle
@dataclass(frozen=True, slots=True)
class ItemRecord:
    """An item of a class that has no schema here, such as an application's own."""

    header: Header
    type: str
    """Name of the class."""
    value: Any
    """What it consists of, in JSON's types."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Hop:
    """One node's share of a latency, in milliseconds."""

    node: str
    wait_ms: float
    """From the previous node's publishing to this one's receiving."""
    work_ms: float
    """From receiving to publishing."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Latency:
    """Time from a measurement's capture to the publishing of its result, by node."""

    stream: str
    seq: Int64
    id: Int64
    """Number of the measurement."""
    source: str
    """Sensor of the measurement."""
    empty: bool
    """Whether it was processed without a result."""
    total_ms: float
    hops: tuple[Hop, ...]

    @classmethod
    def of(cls, message: Message[Any]) -> Latency:
        """Latency of a message, which has one span or more."""
        hops = []
        before = message.captured
        for span in message.spans:
            wait, work = span.received - before, span.published - span.received
            hops.append(Hop(span.node, wait / _MILLISECOND, work / _MILLISECOND))
            before = span.published
        return cls(
            message.stream,
            message.seq,
            message.header.id,
            message.header.source,
            message.item is None,
            message.latency_ns / _MILLISECOND,
            tuple(hops),
        )


@fast_pickle
@dataclass(frozen=True, slots=True)
class Drops:
    """Messages of a stream that did not reach the recorder."""

    stream: str
    dropped: Int64
    """Since the last such message."""
    total: Int64


@fast_pickle
@dataclass(frozen=True, slots=True)
class Labels:
    """Labels of a recorded message beside its own fields."""

    robot: str = ""
    ahead: Int64 = 0
    """Of a mission status: how many waypoints follow its target; the plan has them."""
    actor: str = ""
    """The process that vitals are of."""
    machine: str = ""
    """The machine that vitals are of."""
    cpu_cores: float | None = None
    """Cores that the process used since its last vitals; None for the first ones."""


NO_LABELS = Labels()


class Channel(NamedTuple):
    """How messages of one class are recorded."""

    kind: type[Any]
    name: str
    """Of the schema, after `aerodaas.`."""
    end: str
    """Last part of the topic; with a slash, the whole topic."""
    labels: tuple[str, ...] = ()
    """Labels that each message has."""
    elsewhere: Mapping[str, Any] = {}
    """Fields that are left out, in pydantic's form: other messages have them, or none need them."""
    without_none: bool = False
    """Whether fields that are None are left out, too."""


# Made from the picture, which is recorded: clothes by their colours, and the depth beside it. The
# frame has camera and odometry.
_OF_THE_FRAME = {
    **dict.fromkeys(("camera", "odometry", "nearest"), True),
    "items": {"__all__": {"appearance"}},
}
_TABLE = (
    Channel(VehicleState, "VehicleState", "state", ("robot",), without_none=True),
    Channel(MissionStatus, "MissionStatus", "mission", ("robot", "ahead"), {"pending": True}),
    Channel(MissionPlan, "Plan", "plan", ("robot",)),
    Channel(GeofenceConfig, "Geofence", "fence", ("robot",)),
    Channel(SetpointRecord, "Setpoint", "setpoint", ("robot",)),
    Channel(Photo, "Photo", "photos", ("robot",)),
    Channel(Battery, "Battery", "battery"),
    Channel(FrameInfo, "Frame", "frame", without_none=True),
    Channel(Detections, "Detections", "detections", elsewhere=_OF_THE_FRAME, without_none=True),
    Channel(NavigationRecord, "Navigation", "navigation"),
    Channel(ItemRecord, "Value", "value"),
    Channel(Decision, "Decision", "decision"),
    Channel(Alert, "Alert", "/alerts"),
    Channel(Latency, "Latency", "/latency"),
    Channel(Drops, "Drops", "/drops"),
    Channel(Vitals, "Vitals", "vitals", ("actor", "machine", "cpu_cores")),
)
CHANNELS: Mapping[str, Channel] = {f"aerodaas.{one.name}": one for one in _TABLE}
"""The table, by the name of the schema."""


@lru_cache(maxsize=1024)
def channel_of(kind: type) -> Channel | None:
    """The channel of messages of a class or of the nearest one above it; None without."""
    known = {one.kind: one for one in _TABLE}
    return next((known[one] for one in kind.__mro__ if one in known), None)


def json_entry(
    message: object,
    stream: str = "",
    stamp: int | None = None,
    /,
    **labels: str | float | None,
) -> Entry:
    """A message for its channel.

    Args:
        message: Of a class of the table, or of one derived from it.
        stream: The stream that it came on; of no use where the table has the whole topic.
        stamp: Mission time of the described measurement, nanoseconds, if it differs from the
            envelope's header.
        **labels: What stands before its own fields.

    Returns:
        The entry.

    Raises:
        MessageError: If it is of another class, or a field holds what JSON cannot.
    """
    channel = channel_of(type(message))
    if channel is None:
        raise MessageError(f"{type(message).__name__} is of no class that has a schema here")
    name = channel.end if channel.end.startswith("/") else topic(stream, channel.end)
    data = json_text(
        message, without_none=channel.without_none, without=channel.elsewhere, **labels
    )
    return Entry(name, _schema(channel.name, tuple(labels)), data, stamp)


def labels_and_message(schema: str, text: bytes) -> tuple[Labels, Any]:
    """Read a message from its recorded JSON, which may be a stranger's.

    Args:
        schema: A key of `CHANNELS`.
        text: The JSON text, of the present format.

    Returns:
        The labels and the message.

    Raises:
        MessageError: If a field is malformed, or the robot's id is missing.
    """
    channel = CHANNELS[schema]
    labels = NO_LABELS
    if channel.labels:
        labels = message_of_text(Labels, text, unknown_fields="ignore")
        if "robot" in channel.labels and not labels.robot:
            raise MessageError(f"{channel.name} of no robot")
    return labels, message_of_text(channel.kind, text, unknown_fields="ignore")


@lru_cache(maxsize=64)
def _schema(name: str, labels: tuple[str, ...]) -> Schema:
    """JSON schema of a channel: types of the topmost fields, which is what Foxglove offers."""
    channel = CHANNELS[f"aerodaas.{name}"]
    known = json_schema_of(channel.kind)
    definitions = known.get("$defs", {})
    properties: dict[str, Any] = {label: {} for label in labels}
    for field, part in known["properties"].items():
        if channel.elsewhere.get(field) is not True:
            meant = definitions[part["$ref"].rpartition("/")[2]] if "$ref" in part else part
            # A number that may be NaN is null then, and a number to who draws it.
            types = [meant["type"]] if isinstance(meant.get("type"), str) else meant.get("type")
            properties[field] = {"type": types[0]} if types else {}
    body = {"type": "object", "properties": properties}
    return Schema(name=f"aerodaas.{name}", encoding="jsonschema", data=json.dumps(body).encode())
