"""Decoding and validation of recorded messages: the one place where a stranger's bytes enter.

Whatever reads a recording gets a message whose fields have the types stated here, or does not get
it at all. Fields that a later version adds are passed on.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Annotated, Any, Final, Literal, TypeAlias

from google.protobuf.json_format import MessageToDict
from google.protobuf.message import Message
from mcap.records import Channel, Schema
from mcap_protobuf.decoder import DecoderFactory
from pydantic import BeforeValidator, ConfigDict, Field, TypeAdapter, with_config
from typing_extensions import NotRequired, TypedDict

from aerodaas.cameras.images import IMAGE_SCHEMAS, VIDEO_SCHEMAS, check_picture
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.vehicle import FlightEnd, VehicleMode
from aerodaas.recording.decoding.limits import (
    MAX_DEPTH,
    MAX_JSON,
    MAX_PROTOBUF_FIELDS,
)
from aerodaas.recording.ros.typestore import ROS_TYPES, ros_decoder

__all__ = ["BrokenMessageError", "MessageDecoder", "decode_json", "plain_fields"]

_LONGEST_NS = 10**18
"""Nanoseconds of a mission: thirty years, far within what dates and plots can show."""
_FARTHEST = 1e9
"""Largest figure of a message, whatever its unit; plots fail near the ends of floating point."""

Stamp = Annotated[int, Field(strict=True, ge=-_LONGEST_NS, le=_LONGEST_NS)]
Count = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1)]
Pixels = Annotated[int, Field(strict=True, ge=1, le=1 << 20)]
Number = Annotated[float, Field(strict=True, ge=-_FARTHEST, le=_FARTHEST)]
Gap = Number | None
"""A number, or null in the place of one that is not finite."""
Reading = Annotated[float, Field(strict=True, ge=-1e15, le=1e15)] | None
"""A driver's own figure, which nothing plots: it may count seconds since 1970."""
Word = Annotated[str, Field(strict=True, max_length=4096)]
Text = Annotated[str, Field(strict=True, max_length=1 << 16)]

_OPEN = ConfigDict(extra="allow")


class _Vector(TypedDict):
    x: Gap
    y: Gap
    z: Gap


class _Place(TypedDict):
    x: Number
    y: Number
    z: Number


@with_config(_OPEN)
class _Odometry(TypedDict):
    position: _Vector
    velocity: _Vector
    yaw: Gap
    roll: Gap
    pitch: Gap
    yaw_rate: Gap
    position_sigma: Gap


@with_config(_OPEN)
class _Charge(TypedDict):
    fraction: Gap
    voltage: Gap
    current: Gap


def _count_or_zero(value: object) -> int:
    """A number of satellites; 0, which is none that is known, for anything else."""
    return value if type(value) is int and 0 <= value < 1 << 63 else 0


@with_config(ConfigDict(extra="ignore"))
class _Fix(TypedDict):
    latitude: Gap
    longitude: Gap
    altitude: Gap
    horizontal_sigma: NotRequired[Gap]
    vertical_sigma: NotRequired[Gap]
    satellites: NotRequired[Annotated[int, BeforeValidator(_count_or_zero)]]


@with_config(_OPEN)
class _Attitude(TypedDict):
    stamp: Stamp
    pitch: Gap
    yaw: Gap
    roll: Gap


@with_config(_OPEN)
class _Traffic(TypedDict):
    address: Count
    callsign: Word
    position: _Vector
    velocity: _Vector
    age: Gap


@with_config(_OPEN)
class _VehicleState(TypedDict):
    stamp: Stamp
    robot: Word
    mode: Literal[tuple(mode.value for mode in VehicleMode)]  # type: ignore[valid-type]
    armed: Annotated[bool, Field(strict=True)]
    battery: _Charge
    odometry: _Odometry
    faults: list[Text]
    extra: dict[Word, Reading]
    gps: NotRequired[_Fix | None]
    truth: NotRequired[_Odometry | None]
    gimbal: NotRequired[_Attitude | None]
    zoom: NotRequired[Number | None]
    traffic: NotRequired[list[_Traffic]]
    below: NotRequired[Number | None]
    actuators: NotRequired[dict[Word, Word]]
    ended: NotRequired[Literal[tuple(end.value for end in FlightEnd)] | None]  # type: ignore[valid-type]


@with_config(ConfigDict(extra="ignore"))
class _Outlook(TypedDict):
    plan: Gap
    returns_at: Gap
    hover: Gap


@with_config(_OPEN)
class _MissionStatus(TypedDict):
    stamp: Stamp
    robot: Word
    state: Word
    reason: Text
    visited: list[Word]
    visits: NotRequired[Annotated[int, Field(strict=True, ge=0)]]
    given_up: list[Word]
    distance: Number
    outlook: NotRequired[_Outlook | None]
    pilot: NotRequired[Word]
    unfinished: NotRequired[Text]


@with_config(_OPEN)
class _Waypoint(_Place):
    id: Word


@with_config(_OPEN)
class _Plan(TypedDict):
    robot: Word
    waypoints: list[_Waypoint]


@with_config(_OPEN)
class _Geofence(TypedDict):
    robot: Word
    polygon: list[tuple[Number, Number]]


@with_config(_OPEN)
class _Setpoint(TypedDict):
    stamp: Stamp
    robot: Word
    asked: dict[str, Any] | None
    clipped_by: list[Word]


@with_config(_OPEN)
class _Hop(TypedDict):
    node: Word
    wait_ms: Number
    work_ms: Number


@with_config(_OPEN)
class _Latency(TypedDict):
    stream: Word
    empty: NotRequired[bool]
    total_ms: Number
    hops: list[_Hop]


@with_config(_OPEN)
class _Frame(TypedDict):
    id: Count
    stamp: Stamp
    source: Word
    width: Pixels
    height: Pixels
    odometry: NotRequired[_Odometry | None]


@with_config(_OPEN)
class _Detection(TypedDict):
    label: Word
    score: Number
    box: Annotated[list[Number], Field(min_length=4, max_length=4)]
    track_id: NotRequired[Annotated[int, Field(strict=True)] | None]
    keypoints: NotRequired[
        Annotated[
            list[Annotated[list[Gap], Field(min_length=3, max_length=3)]], Field(max_length=10_000)
        ]
        | None
    ]
    depth: NotRequired[Gap]


def _without_gaps(items: object) -> object:
    """Detections whose score and box are numbers: one that is not finite costs no other."""
    if not isinstance(items, list):
        return items
    return [item for item in items if not (isinstance(item, dict) and _has_gap(item))]


def _has_gap(item: dict[str, Any]) -> bool:
    box = item.get("box")
    return item.get("score", 0.0) is None or (isinstance(box, list) and None in box)


@with_config(_OPEN)
class _Detections(TypedDict):
    id: Count
    stamp: Stamp
    source: Word
    width: Pixels
    height: Pixels
    items: Annotated[list[_Detection], BeforeValidator(_without_gaps)]


@with_config(_OPEN)
class _Decision(TypedDict):
    stamp: Stamp
    task: Word
    action: Word
    reason: Text
    values: dict[Word, Number]


@with_config(_OPEN)
class _Alert(TypedDict):
    stamp: Stamp
    source: Word
    kind: Word
    text: Text


@with_config(_OPEN)
class _Drops(TypedDict):
    stream: Word
    total: Count


@with_config(_OPEN)
class _Gpu(TypedDict):
    busy: Number
    memory: Number


@with_config(_OPEN)
class _Vitals(TypedDict):
    stamp: Stamp
    actor: Word
    machine: Word
    memory_mb: Number
    machine_cpu: Number
    machine_memory: Number
    cpu_cores: NotRequired[Number]
    gpus: NotRequired[Annotated[list[_Gpu], Field(max_length=64)]]


@with_config(_OPEN)
class _Navigation(TypedDict):
    stamp: Stamp
    source: Word
    type: Word
    waypoints: list[Any]
    commands: list[Any]


@with_config(_OPEN)
class _Value(TypedDict):
    stamp: Stamp
    source: Word
    value: Any


_SHAPES: Final[dict[str, TypeAdapter[Any]]] = {
    f"aerodaas.{shape.__name__.removeprefix('_')}": TypeAdapter(shape)
    for shape in (
        _VehicleState,
        _MissionStatus,
        _Plan,
        _Geofence,
        _Setpoint,
        _Latency,
        _Frame,
        _Detections,
        _Decision,
        _Alert,
        _Drops,
        _Vitals,
        _Navigation,
        _Value,
    )
}
"""Checks of this project's own messages by the name of their schema."""
Decoder: TypeAlias = Callable[[bytes], Any]
_PICTURES = IMAGE_SCHEMAS | VIDEO_SCHEMAS
_ESCAPED_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")


class BrokenMessageError(ValueError):
    """A message cannot be decoded, or is not what its schema's name promises."""


class MessageDecoder:
    """Decoder of the messages of one recording."""

    def __init__(self) -> None:
        self._protobuf = DecoderFactory()
        self._decoders: dict[int, Decoder] = {}

    def decode(self, channel: Channel, schema: Schema | None, data: bytes) -> Any:  # noqa: ANN401 - by the channel
        """Decode and check one message.

        Args:
            channel: Its channel.
            schema: The schema of the channel; None for none.
            data: The message's bytes.

        Returns:
            A dictionary for JSON, an object with fields for protobuf and `ROS_TYPES`, else
            the bytes.

        Raises:
            BrokenMessageError: If the message is broken; the others of its channel may be whole.
            ConfigError: If decoding needs an extra that is not installed.
        """
        name = schema.name if schema else ""
        try:
            value = self._decoder(channel, schema)(data)
            if name in _PICTURES:
                check_picture(value, video=name in VIDEO_SCHEMAS)
            elif name in _SHAPES:
                value = _SHAPES[name].validate_python(value)
        except AeroDaaSError:
            raise
        except Exception as error:
            # The decoders of other projects build classes from a schema in the file, and raise
            # whatever these stumble over.
            raise BrokenMessageError(f"{channel.topic}: {error}") from error
        return value

    def _decoder(self, channel: Channel, schema: Schema | None) -> Decoder:
        if channel.id not in self._decoders:
            try:
                self._decoders[channel.id] = self._made(channel.message_encoding, schema)
            except AeroDaaSError:
                raise
            except Exception as error:  # noqa: BLE001 - see `decode`
                # Kept, for a schema that cannot be built may take long to fail.
                self._decoders[channel.id] = _refusing(f"its schema is broken: {error}")
        return self._decoders[channel.id]

    def _made(self, encoding: str, schema: Schema | None) -> Decoder:
        found = self._protobuf.decoder_for(encoding, schema)
        if found is not None:
            return found
        if encoding == "cdr" and schema is not None and schema.name in ROS_TYPES:
            return ros_decoder(schema.name)
        return decode_json if encoding == "json" else bytes


def _refusing(reason: str) -> Decoder:
    def refuse(_data: bytes) -> Any:  # noqa: ANN401 - a decoder's
        raise BrokenMessageError(reason)

    return refuse


def decode_json(data: bytes) -> Any:  # noqa: ANN401 - any JSON value
    """Decode JSON that is no longer and no deeper than ours ever is; raises ValueError.

    Lone surrogates are refused: no file can be written with them.
    """
    if len(data) > MAX_JSON:
        raise ValueError(f"a JSON message of {len(data)} bytes exceeds {MAX_JSON}")
    try:
        value = json.loads(data)
    except RecursionError:
        raise ValueError("JSON that is nested too deeply") from None
    if data.count(b"[") + data.count(b"{") > MAX_DEPTH and _depth(value) > MAX_DEPTH:
        raise ValueError(f"JSON nested more than {MAX_DEPTH} levels deep")
    if _ESCAPED_SURROGATE.search(data):
        json.dumps(value, ensure_ascii=False).encode()
    return value


def plain_fields(message: Message) -> dict[str, Any]:
    """A protobuf message as a dictionary; bytes as their length instead of Base64.

    Raises:
        BrokenMessageError: If the schema in the file is none that can be read so.
    """
    try:
        lengths = {
            field.name: f"<{len(value)} bytes>"
            for field, value in message.ListFields()
            if isinstance(value, bytes)
        }
        for name in lengths:
            message.ClearField(name)
        if message.ByteSize() > MAX_PROTOBUF_FIELDS:
            raise ValueError(  # noqa: TRY301 - told as all that is wrong with it
                f"more than {MAX_PROTOBUF_FIELDS} bytes of fields"
            )
        fields: dict[str, Any] = MessageToDict(message, preserving_proto_field_name=True)
        json.dumps(fields, ensure_ascii=False).encode()
    except Exception as error:
        # As in `MessageDecoder.decode`: a stranger's schema may misuse well-known names.
        raise BrokenMessageError(f"not a message with plain fields: {error}") from error
    return fields | lengths


def _depth(value: object) -> int:
    """Levels of nesting, by iteration: recursion is what is to be prevented."""
    depth, level = 0, [value]
    while level and depth <= MAX_DEPTH:
        depth += 1
        inner: list[object] = []
        for item in level:
            if isinstance(item, dict):
                inner.extend(one for one in item.values() if isinstance(one, dict | list))
            elif isinstance(item, list):
                inner.extend(one for one in item if isinstance(one, dict | list))
        level = inner
    return depth
