"""Index of an MCAP file, from its summary or, for a cut-off file, from a scan.

The format is https://mcap.dev/spec: records of an opcode, a length and a body, most of them
inside compressed chunks.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO, cast

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import read_magic
from mcap.summary import Summary

from aerodaas.recording.decoding.limits import (
    MAX_CHANNELS,
    MAX_CHUNK,
    MAX_METADATA,
    MAX_RATIO,
    MAX_UNPACKED,
)

__all__ = ["BROKEN", "Block", "FileIndex", "TooLargeError", "load", "read_index"]

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
_READ_RECORDS = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})
_CHUNK_SIZE = struct.Struct("<QQQ")
"""How a chunk begins: first time, last time, bytes once unpacked."""
_NEVER = 1 << 64
"""Later than any log time."""
_TIMES = 16
"""Bytes of an attachment's two times, before its name."""
_LONGEST_NAME = 4096
"""Bytes of an attachment's name that are read."""
_LOOSE = 1 << 20
"""Bytes up to which messages outside chunks are gathered into one block."""


class TooLargeError(ValueError):
    """A recording exceeds one of the bounds in `limits`."""


def unpacked(chunk: Chunk) -> bytes:
    """The records of a chunk.

    Args:
        chunk: The chunk as it is in the file.

    Returns:
        Its contents; `chunk.uncompressed_size` bytes.

    Raises:
        TooLargeError: If it has more than `MAX_CHUNK` bytes, or more than it says.
        ValueError: If it is damaged, or packed in a way unknown.
    """
    size = chunk.uncompressed_size
    if size > MAX_CHUNK:
        raise TooLargeError(f"has a chunk of {size} bytes, more than {MAX_CHUNK}")
    # One byte more than it says shows a lie without unpacking all of it.
    if chunk.compression == "zstd":
        reader = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK).stream_reader(
            BytesIO(chunk.data), read_across_frames=True
        )
        data = reader.read(size + 1)
    elif chunk.compression == "lz4":
        try:
            data = LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        except RuntimeError as error:
            raise ValueError(f"LZ4: {error}") from None
    elif not chunk.compression:
        data = chunk.data
    else:
        raise ValueError(f"chunks packed by {chunk.compression!r} cannot be read")
    if len(data) > size:
        raise TooLargeError(f"has a chunk with more than the {size} bytes that it claims")
    if len(data) < size:
        raise ValueError(f"a chunk has {len(data)} of {size} bytes")
    return data


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
    size: int = 0
    """Bytes once unpacked, as the file says; more are never unpacked."""
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


class _Clamped:
    """A file that is never asked for more bytes than it has: a length in it may be a lie."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        self.seek, self.tell, self.seekable = file.seek, file.tell, file.seekable

    def read(self, length: int = -1) -> bytes:
        rest = max(0, self._size - self._file.tell())
        return self._file.read(rest if length < 0 else min(length, rest))


def read_index(file: BinaryIO, size: int) -> FileIndex:
    """Index a file.

    Args:
        file: The file, open.
        size: Bytes of it to be read.

    Raises:
        Exception: One of `BROKEN`, if it is not MCAP or too large.
    """
    read_magic(ReadDataStream(file))
    clamped = cast("BinaryIO", _Clamped(file, size))
    try:
        clamped.seek(0)
        summary = make_reader(clamped).get_summary()
        if summary is not None and _tells_all(summary) and _intact(clamped, size):
            return _bounded(_from_summary(clamped, summary, size), size)
    except TooLargeError:
        raise
    except (*BROKEN, OSError):
        pass
    return _bounded(_scan(clamped, size), size)


def load(file: BinaryIO, block: Block) -> Iterator[McapRecord]:
    """Yield the records of a block.

    Args:
        file: The file, open.
        block: The block.

    Raises:
        Exception: One of `BROKEN`, if it is damaged or too large.
    """
    file.seek(block.offset)
    data = file.read(block.length)
    if block.chunked:
        chunk = Chunk.read(ReadDataStream(BytesIO(data[_RECORD_HEAD:])))
        if chunk.uncompressed_size != block.size:
            raise ValueError("a chunk and the file's index differ in its size")
        data = unpacked(chunk)
        if chunk.uncompressed_crc not in {0, zlib.crc32(data)}:
            raise ValueError("the checksum of a chunk does not match")
    offset = 0
    while offset < len(data):
        opcode, length = struct.unpack_from("<BQ", data, offset)
        offset += _RECORD_HEAD
        if offset + length > len(data):
            raise ValueError("a record reaches beyond its chunk")
        if opcode in _READ_RECORDS:
            stream = ReadDataStream(BytesIO(data[offset : offset + length]))
            if opcode == Opcode.MESSAGE:
                yield Message.read(stream, length)
            else:
                yield (Schema if opcode == Opcode.SCHEMA else Channel).read(stream)
        offset += length


def _bounded(index: FileIndex, size: int) -> FileIndex:
    """Return `index`; raise TooLargeError if the file would unpack to far more than it is."""
    if max(len(index.channels), len(index.schemas)) > MAX_CHANNELS:
        raise TooLargeError(f"has more than {MAX_CHANNELS} channels or schemas; it is not read")
    _check_unpacked(sum(block.size for block in index.blocks), size)
    return index


def _check_unpacked(whole: int, size: int) -> None:
    if whole > MAX_UNPACKED + MAX_RATIO * size:
        raise TooLargeError(
            f"has {size} bytes and would unpack to {whole} or more, as no recording of a flight "
            "does; it is not read"
        )


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


def _from_summary(file: BinaryIO, summary: Summary, size: int) -> FileIndex:
    index = FileIndex(complete=True, schemas=summary.schemas, channels=summary.channels)
    index.blocks = [
        Block(
            chunk.chunk_start_offset,
            chunk.chunk_length,
            chunked=True,
            start=chunk.message_start_time,
            end=chunk.message_end_time,
            channels=set(chunk.message_index_offsets),
            size=chunk.uncompressed_size,
        )
        for chunk in summary.chunk_indexes
    ]
    if summary.statistics is not None:
        index.counts.update(summary.statistics.channel_message_counts)
    named = sum(place.length for place in summary.metadata_indexes)
    if named + sum(place.length for place in summary.attachment_indexes) > size:
        # Each would be read, and kept, as often as it is named.
        raise ValueError("the file's index names records that lie over one another")
    for place in summary.metadata_indexes:
        file.seek(place.offset)
        _, length = struct.unpack("<BQ", file.read(_RECORD_HEAD))
        if _RECORD_HEAD + length != place.length:
            raise ValueError("a metadata record and the file's index differ in its size")
        _enter_metadata(index, file, length)
    index.attachments = {
        place.name: (place.offset, min(place.length, size)) for place in summary.attachment_indexes
    }
    return index


def _scan(file: BinaryIO, size: int) -> FileIndex:
    index = FileIndex(complete=False)
    offset = _MAGIC
    over = False
    whole = 0
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
        if opcode == Opcode.CHUNK and length >= _CHUNK_SIZE.size:
            # Before it is unpacked, and outside of what passes for damage.
            whole += _CHUNK_SIZE.unpack(file.read(_CHUNK_SIZE.size))[2]
            _check_unpacked(whole, size)
            file.seek(offset + _RECORD_HEAD)
        try:
            if not over:
                _enter(index, file, opcode, offset, end)
        except BROKEN:
            index.damaged += 1
        offset = end
    return index


def _enter(index: FileIndex, file: BinaryIO, opcode: int, offset: int, end: int) -> None:
    if opcode == Opcode.CHUNK:
        block = Block(offset, end - offset, chunked=True)
        _, _, block.size = _CHUNK_SIZE.unpack(file.read(_CHUNK_SIZE.size))
        _enter_messages(index, block, load(file, block))
    elif opcode == Opcode.METADATA:
        _enter_metadata(index, file, end - offset - _RECORD_HEAD)
    elif opcode == Opcode.ATTACHMENT:
        head = BytesIO(file.read(min(end - offset - _RECORD_HEAD, _TIMES + 4 + _LONGEST_NAME)))
        head.seek(_TIMES)
        name = ReadDataStream(head).read_prefixed_string()
        index.attachments[name] = (offset, end - offset)
    elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}:
        block = Block(offset, end - offset, chunked=False)
        _enter_messages(index, block, load(file, block))


def _enter_metadata(index: FileIndex, file: BinaryIO, length: int) -> None:
    if length > MAX_METADATA:
        index.damaged += 1
        return
    index.metadata.append(Metadata.read(ReadDataStream(BytesIO(file.read(length)))))


def _enter_messages(index: FileIndex, block: Block, records: Iterable[McapRecord]) -> None:
    # Entered once the whole block was read: half a chunk counts for nothing.
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    counts: Counter[int] = Counter()
    start, end = _NEVER, 0
    for record in records:
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            start, end = min(start, record.log_time), max(end, record.log_time)
            counts[record.channel_id] += 1
    index.schemas |= schemas
    index.channels |= channels
    index.counts += counts
    if not counts:
        return
    block.start, block.end, block.channels = start, end, set(counts)
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
