"""Index of an MCAP file, from its summary or, for a cut-off file, from a scan.

The format is https://mcap.dev/spec: records of an opcode, a length and a body, most of them
inside compressed chunks.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk, read_magic
from mcap.summary import Summary

__all__ = ["BROKEN", "Block", "FileIndex", "load", "read_index"]

BROKEN = (
    McapError,
    struct.error,
    ValueError,
    KeyError,
    OverflowError,
    MemoryError,
    RuntimeError,
    zstandard.ZstdError,
)
"""Exceptions that reading damaged bytes may raise."""

_MAGIC = 8
_RECORD_HEAD = 9
_CHECKSUM = 4
_FOOTER_END = 8 + 8 + _CHECKSUM + _MAGIC
"""Bytes from the footer's first field, the summary's offset, to the end of the file."""
_LOOSE = 1 << 20
"""Bytes up to which messages outside chunks are gathered into one block."""


@dataclass(slots=True)
class Block:
    """A chunk, or a run of messages outside chunks."""

    offset: int
    length: int
    chunked: bool
    start: int = 0
    """Earliest log time."""
    end: int = 0
    """Latest log time."""
    channels: set[int] = field(default_factory=set)
    """Ids of the channels with messages in the block."""
    damaged: bool = False
    """Whether reading the block has failed."""


@dataclass(slots=True)
class FileIndex:
    """Index of an MCAP file: schemas, channels, blocks, metadata and attachments."""

    complete: bool
    """Whether the file was closed properly."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    counts: Counter[int] = field(default_factory=Counter)
    """Number of messages by channel id."""
    metadata: list[Metadata] = field(default_factory=list)
    attachments: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Offset and length of each attachment's record, by name."""
    damaged: int = 0
    """Number of chunks that could not be read."""


def read_index(file: BinaryIO, size: int) -> FileIndex:
    """Index a file of `size` bytes; raises one of `BROKEN` if it is not MCAP."""
    read_magic(ReadDataStream(file))
    try:
        file.seek(0)
        summary = make_reader(file).get_summary()
        if summary is not None and _tells_all(summary) and _intact(file, size):
            return _from_summary(file, summary)
    except (*BROKEN, OSError):
        pass
    return _scan(file, size)


def load(file: BinaryIO, block: Block) -> list[McapRecord]:
    """Read the records of a block; raises one of `BROKEN` if it is damaged."""
    file.seek(block.offset)
    data = file.read(block.length)
    if block.chunked:
        chunk = Chunk.read(ReadDataStream(BytesIO(data[_RECORD_HEAD:])))
    else:
        chunk = Chunk(
            compression="",
            data=data,
            message_start_time=block.start,
            message_end_time=block.end,
            uncompressed_crc=0,
            uncompressed_size=len(data),
        )
    return breakup_chunk(chunk, validate_crc=True)


def _tells_all(summary: Summary) -> bool:
    """Whether a summary indexes the whole file; its writer may leave out any part of it."""
    told = summary.statistics
    return (
        told is not None
        and (bool(summary.chunk_indexes) or not told.message_count)
        and all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
        and len(summary.chunk_indexes) == told.chunk_count
        and len(summary.channels) == told.channel_count
        and len(summary.schemas) == told.schema_count
        and len(summary.metadata_indexes) == told.metadata_count
        and len(summary.attachment_indexes) == told.attachment_count
    )


def _intact(file: BinaryIO, size: int) -> bool:
    """Whether the summary's checksum matches; true if its writer stored no checksum."""
    file.seek(size - _FOOTER_END)
    start, _, checksum = struct.unpack("<QQI", file.read(_FOOTER_END - _MAGIC))
    file.seek(start)
    return checksum in {0, zlib.crc32(file.read(size - _MAGIC - _CHECKSUM - start))}


def _from_summary(file: BinaryIO, summary: Summary) -> FileIndex:
    index = FileIndex(complete=True, schemas=summary.schemas, channels=summary.channels)
    index.blocks = [
        Block(
            chunk.chunk_start_offset,
            chunk.chunk_length,
            chunked=True,
            start=chunk.message_start_time,
            end=chunk.message_end_time,
            channels=set(chunk.message_index_offsets),
        )
        for chunk in summary.chunk_indexes
    ]
    if summary.statistics is not None:
        index.counts.update(summary.statistics.channel_message_counts)
    for place in summary.metadata_indexes:
        file.seek(place.offset + _RECORD_HEAD)
        index.metadata.append(Metadata.read(ReadDataStream(file)))
    index.attachments = {
        place.name: (place.offset, place.length) for place in summary.attachment_indexes
    }
    return index


def _scan(file: BinaryIO, size: int) -> FileIndex:
    index = FileIndex(complete=False)
    offset = _MAGIC
    over = False
    while offset + _RECORD_HEAD <= size:
        file.seek(offset)
        opcode, length = struct.unpack("<BQ", file.read(_RECORD_HEAD))
        end = offset + _RECORD_HEAD + length
        # There is no opcode 0: a machine that lost power may leave gigabytes of zeros.
        if end > size or opcode in {0, Opcode.FOOTER}:
            index.complete = opcode != 0 and end + _MAGIC == size
            break
        # The records after the end of the data, the index, only repeat earlier ones.
        over = over or opcode == Opcode.DATA_END
        try:
            if not over:
                _enter(index, file, opcode, offset, end)
        except BROKEN:
            index.damaged += 1
        offset = end
    return index


def _enter(index: FileIndex, file: BinaryIO, opcode: int, offset: int, end: int) -> None:
    stream = ReadDataStream(file)
    if opcode == Opcode.CHUNK:
        block = Block(offset, end - offset, chunked=True)
        _enter_messages(index, block, load(file, block))
    elif opcode == Opcode.METADATA:
        index.metadata.append(Metadata.read(stream))
    elif opcode == Opcode.ATTACHMENT:
        index.attachments[Attachment.read(stream).name] = (offset, end - offset)
    elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}:
        block = Block(offset, end - offset, chunked=False)
        _enter_messages(index, block, load(file, block))


def _enter_messages(index: FileIndex, block: Block, records: Iterable[McapRecord]) -> None:
    times = []
    for record in records:
        if isinstance(record, Schema):
            index.schemas[record.id] = record
        elif isinstance(record, Channel):
            index.channels[record.id] = record
        elif isinstance(record, Message):
            times.append(record.log_time)
            block.channels.add(record.channel_id)
            index.counts[record.channel_id] += 1
    if not times:
        return
    block.start, block.end = min(times), max(times)
    last = index.blocks[-1] if index.blocks else None
    if (
        last is not None
        and not last.chunked
        and not block.chunked
        and last.offset + last.length == block.offset
        and last.length < _LOOSE
    ):
        last.length += block.length
        last.start, last.end = min(last.start, block.start), max(last.end, block.end)
        last.channels |= block.channels
    else:
        index.blocks.append(block)
