"""Decoding and validation of recorded messages: the one place where a stranger's bytes enter.

Whatever reads a recording gets a message whose fields have the types of its class, or does not get
it at all. Fields that a later version adds are left out.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeAlias

from google.protobuf.json_format import MessageToDict
from google.protobuf.message import Message
from mcap.records import Channel, Schema
from mcap_protobuf.decoder import DecoderFactory
from pydantic_core import to_json

from aerodaas.cameras.images import IMAGE_SCHEMAS, VIDEO_SCHEMAS, check_picture
from aerodaas.config.extensions import extensions, imported
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.detections import Detections
from aerodaas.messages.mission import Decision, MissionStatus
from aerodaas.messages.serialization.schema import MessageError
from aerodaas.recording.decoding.limits import (
    MAX_DEPTH,
    MAX_JSON,
    MAX_NUMBER,
    MAX_PROTOBUF_FIELDS,
)
from aerodaas.recording.decoding.old_shapes import conversions
from aerodaas.recording.messages import CHANNELS, NO_LABELS, Labels, labels_and_message

__all__ = ["BrokenMessageError", "MessageDecoder", "decode_json", "plain_fields"]

Decoder: TypeAlias = Callable[[bytes], Any]
_PICTURES = IMAGE_SCHEMAS | VIDEO_SCHEMAS
_ESCAPED_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")
_DIGITS = bytes.maketrans(b"123456789+E", b"0000000000e")
_LARGE = (b"0e0", 22 * b"0")
"""A text has one of these, translated by `_DIGITS`, if a number of it is far over `MAX_NUMBER`."""
_NO_NUMBERS = (b"NaN", b"Infinity")


class BrokenMessageError(ValueError):
    """A message cannot be decoded, or is not what its schema's name promises."""


class MessageDecoder:
    """Decoder of the messages of one recording."""

    def __init__(self, recorded_format: str) -> None:
        """Decode messages of a format; empty for that of a recording without a number."""
        self._conversions = conversions(recorded_format)
        self._protobuf = DecoderFactory()
        self._decoders: dict[int, Decoder] = {}

    def decode(
        self, channel: Channel, schema: Schema | None, data: bytes, *, as_json: bool = False
    ) -> tuple[Labels, Any]:
        """Decode and check one message.

        Args:
            channel: Its channel.
            schema: The schema of the channel; None for none.
            data: The message's bytes.
            as_json: Whether a message of this project is left as the JSON value that was recorded.

        Returns:
            Its labels, and a message of this project, a dictionary for other JSON, an object with
            fields for protobuf and what an extension decodes, else the bytes.

        Raises:
            BrokenMessageError: If the message is broken; the others of its channel may be whole.
            ConfigError: If decoding needs an extra that is not installed.
        """
        name = schema.name if schema else ""
        if name in CHANNELS and channel.message_encoding != "json":
            raise BrokenMessageError(f"{channel.topic}: {name} is not encoded as JSON")
        try:
            if name in CHANNELS:
                labels, message = self._message(name, data)
                return labels, decode_json(data) if as_json else message
            value = self._decoder(channel, schema)(data)
            if name in _PICTURES:
                check_picture(value, video=name in VIDEO_SCHEMAS)
        except MessageError as error:
            raise BrokenMessageError(f"{channel.topic}: {error}") from None
        except AeroDaaSError:
            raise
        except Exception as error:
            # The decoders of other projects build classes from a schema in the file, and raise
            # whatever these stumble over.
            raise BrokenMessageError(f"{channel.topic}: {error}") from error
        return NO_LABELS, value

    def _message(self, name: str, data: bytes) -> tuple[Labels, Any]:
        convert = self._conversions.get(name)
        if convert is not None or len(data) > MAX_JSON or _may_be_large(data):
            value = decode_json(data)
            _check_numbers(value)
            data = to_json(value if convert is None else convert(value))
        labels, message = labels_and_message(name, data)
        return labels, _known(message)

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
        name = schema.name if schema is not None else ""
        for extension in extensions().values():
            place = extension.decoders.get(encoding)
            if place is not None and (found := imported(place)(name)) is not None:
                return found
        return decode_json if encoding == "json" else bytes


def _known(message: Any) -> Any:  # noqa: ANN401 - of any class
    """A message without the parts of a list that are not numbers.

    Raises:
        BrokenMessageError: If a figure without which nothing can be said is not a number.
    """
    if isinstance(message, Detections):
        items = tuple(
            one for one in message.items if all(map(math.isfinite, (one.score, *one.box)))
        )
        return message if len(items) == len(message) else replace(message, items=items)
    if isinstance(message, Decision):
        values = {name: one for name, one in message.values.items() if math.isfinite(one)}
        return message if len(values) == len(message.values) else replace(message, values=values)
    if isinstance(message, MissionStatus) and not math.isfinite(message.distance):
        raise BrokenMessageError("a mission's distance is not a number")
    return message


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


def _may_be_large(data: bytes) -> bool:
    """Whether a JSON text may hold a number beyond `MAX_NUMBER`, or one that is none."""
    digits = data.translate(_DIGITS)
    return any(part in digits for part in _LARGE) or any(part in data for part in _NO_NUMBERS)


def _check_numbers(value: object) -> None:
    """Raise ValueError for a number beyond `MAX_NUMBER`, or that is none."""
    for level in _levels(value):
        for item in level:
            if isinstance(item, int | float) and not abs(item) <= MAX_NUMBER:
                raise ValueError(f"a number beyond {MAX_NUMBER:g}")


def _depth(value: object) -> int:
    """Levels of lists and objects within one another."""
    levels = _levels(value)
    return sum(1 for level in levels if any(isinstance(one, dict | list) for one in level))


def _levels(value: object) -> Iterator[list[object]]:
    """All values, level by level: recursion is what is to be prevented."""
    level = [value]
    while level:
        yield level
        inner: list[object] = []
        for item in level:
            if isinstance(item, dict):
                inner.extend(item.values())
            elif isinstance(item, list):
                inner.extend(item)
        level = inner
