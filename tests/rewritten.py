"""A recording written anew with other messages, attachments or metadata."""

from __future__ import annotations

import json
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

Change = Callable[[str, bytes], bytes | None]
"""New data of a message, by topic and old data; None leaves it out."""


def rewritten(
    path: Path,
    new: Path,
    *,
    change: Change = lambda _topic, data: data,
    environment: bytes | None = None,
) -> Path:
    """Write `path` anew to `new`: a whole container around messages that may not be."""
    new.write_bytes(rebuilt(path.read_bytes(), change=change, environment=environment))
    return new


def rebuilt(
    old: bytes,
    *,
    change: Change = lambda _topic, data: data,
    environment: bytes | None = None,
) -> bytes:
    """The bytes of a recording with its messages changed and another environment, if given."""
    reader = make_reader(BytesIO(old))
    file = BytesIO()
    writer = Writer(file, compression=CompressionType.ZSTD)
    writer.start()
    for metadata in reader.iter_metadata():
        writer.add_metadata(metadata.name, metadata.metadata)
    for attachment in reader.iter_attachments():
        data = attachment.data
        if environment is not None and attachment.name == "environment.json":
            data = environment
        writer.add_attachment(1, 1, attachment.name, attachment.media_type, data)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for schema, channel, message in reader.iter_messages():
        if channel.id not in channels:
            number = 0
            if schema is not None:
                if schema.id not in schemas:
                    schemas[schema.id] = writer.register_schema(
                        schema.name, schema.encoding, schema.data
                    )
                number = schemas[schema.id]
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, number
            )
        new = change(channel.topic, message.data)
        if new is not None:
            writer.add_message(
                channels[channel.id], message.log_time, new, message.publish_time, message.sequence
            )
    writer.finish()
    return file.getvalue()


def fields(value: object, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Places of all fields in a JSON value."""
    found = []
    if isinstance(value, dict):
        for key, item in value.items():
            found += [(*place, key), *fields(item, (*place, key))]
    elif isinstance(value, list) and value:
        found += [(*place, 0), *fields(value[0], (*place, 0))]
    return found


def with_field(value: Any, place: tuple[Any, ...], odd: object) -> Any:  # noqa: ANN401
    """The value with another thing at a place; without the field for `...`."""
    copy = json.loads(json.dumps(value))
    inside = copy
    for part in place[:-1]:
        inside = inside[part]
    if odd is ...:
        del inside[place[-1]]
    else:
        inside[place[-1]] = odd
    return copy
