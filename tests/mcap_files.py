"""MCAP files as others write them: with chunks or without, with an index or without."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType, Writer

END = bytes([Opcode.DATA_END]) + (4).to_bytes(8, "little")
"""How the record begins that ends the messages; what follows it is the index."""


class Said(NamedTuple):
    """One message: a topic, its log time in nanoseconds and a number."""

    topic: str
    time: int
    number: int


KINDS: dict[str, dict[str, Any]] = {
    "chunks": {},
    "small chunks": {"chunk_size": 1},
    "no checksums": {"enable_crcs": False},
    "no statistics": {"use_statistics": False},
    "no channels in the index": {"repeat_channels": False},
    "no schemas in the index": {"repeat_schemas": False},
    "no metadata in the index": {"index_types": IndexType.ALL ^ IndexType.METADATA},
    "no attachments in the index": {"index_types": IndexType.ALL ^ IndexType.ATTACHMENT},
    "no messages in the index": {"index_types": IndexType.ALL ^ IndexType.MESSAGE},
    "no chunks in the index": {"index_types": IndexType.ALL ^ IndexType.CHUNK},
    "no index": {"index_types": IndexType.NONE},
    "no chunks": {"use_chunking": False},
    "nothing but messages": {
        "use_chunking": False,
        "use_statistics": False,
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_summary_offsets": False,
    },
}
"""Options of the writer, by what a file of that kind has or lacks."""


def write_file(
    path: Path,
    said: Iterable[Said],
    kind: str = "chunks",
    metadata: dict[str, dict[str, str]] | None = None,
    *,
    finish: bool = True,
) -> Path:
    """Write JSON messages, published 10 ns before they were logged, numbered from 0 on.

    One attachment, `notes`, lies before them. Unfinished, the file ends after the last message.
    """
    channels: dict[str, int] = {}
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, **KINDS[kind])
        writer.start()
        for name, values in (metadata or {}).items():
            writer.add_metadata(name, values)
        writer.add_attachment(1, 1, "notes", "text/plain", b"calm, 12 degrees")
        schema = writer.register_schema("own.Said", "jsonschema", b"{}")
        for sequence, (topic, time, number) in enumerate(said):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schema)
            data = json.dumps({"number": number}).encode()
            writer.add_message(channels[topic], time, data, time - 10, sequence)
        writer.finish()
    if not finish:
        whole = path.read_bytes()
        path.write_bytes(whole[: whole.rindex(END)])
    return path
