"""Attaching a file to a recording that is finished, without touching what it holds.

MCAP (https://mcap.dev/spec) has attachments among its chunks and an index of them in the summary at
its end. The recording is written anew beside itself, its records copied byte by byte, and takes its
own place in one step: whatever interrupts that leaves the old one or the new one, whole.
"""

from __future__ import annotations

import os
import shutil
import struct
import tempfile
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, DataEnd, Footer, Statistics, SummaryOffset

from aerodaas.errors import RecordingError
from aerodaas.recording.decoding.index import BROKEN
from aerodaas.recording.reader import Recording

__all__ = ["attach_file"]

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""
_BLOCK = 1 << 20
_STILL = 5.0
"""Seconds without a write after which nobody is writing a recording that was not closed: who does
writes twice a second."""


@dataclass(frozen=True, slots=True)
class _Ending:
    """Where a recording's data ends, and what comes after."""

    data: int
    """Offset of the end of the last whole record."""
    checksum: int
    """CRC-32 of the data, 0 for none."""
    summary: list[tuple[int, bytes]]
    """Opcode and bytes of each record of the summary."""
    closed: bool
    """Whether it was closed properly, with the end of its data, summary and footer."""


def attach_file(recording: Path, file: Path, name: str, media_type: str, stamp: int) -> None:
    """Attach a file to a recording; one that was cut off stays so, and keeps all that it holds.

    Args:
        recording: The MCAP file.
        file: What to attach.
        name: Name of the attachment.
        media_type: Its media type.
        stamp: Nanoseconds since the Unix epoch at which it begins.

    Raises:
        RecordingError: If the recording has an attachment of this name, is still written, or cannot
            be read or replaced; it is then as it was.
    """
    recording = recording.resolve()
    with Recording.open(recording) as opened:
        if name in opened.attachments:
            raise RecordingError(
                f"{recording} has {name} already; rename the file if it is another one"
            )
        complete = opened.complete
    part: Path | None = None
    try:
        before = recording.stat()
        if not complete and abs(time.time() - before.st_mtime) < _STILL:
            raise RecordingError(
                f"{recording} is still being written, or was a moment ago; attach to it once the "
                "flight is over"
            )
        part = _new_file_beside(recording)
        with recording.open("rb") as old, file.open("rb") as attached, part.open("wb") as new:
            _rewrite(old, new, attached, file.stat().st_size, (name, media_type, stamp))
            new.flush()
            os.fsync(new.fileno())
        shutil.copymode(recording, part)
        _check_same(recording, part, name)
        if _state(recording.stat()) != _state(before):
            raise RecordingError(
                f"{recording} was changed meanwhile; attach to it once nobody writes it"
            )
        part.replace(recording)
        _sync_folder(recording.parent)
    except OSError as error:
        raise RecordingError(
            f"cannot attach {file} to {recording}: {error.strerror}; the recording is as it was"
        ) from None
    except BROKEN as error:
        raise RecordingError(f"{recording} {_DAMAGED} ({error})") from None
    finally:
        if part is not None:
            part.unlink(missing_ok=True)


_DAMAGED = "is damaged in a way that nothing can be attached; it is as it was"


def _new_file_beside(recording: Path) -> Path:
    handle, path = tempfile.mkstemp(
        prefix=f".{recording.name}.", suffix=".part", dir=recording.parent
    )
    os.close(handle)
    return Path(path)


def _state(told: os.stat_result) -> tuple[int, int, int]:
    return told.st_ino, told.st_size, told.st_mtime_ns


def _check_same(recording: Path, part: Path, name: str) -> None:
    """Raise RecordingError unless the new file holds all that can be read in the old one."""
    with Recording.open(recording) as old, Recording.open(part) as new:
        same = (old.complete, old.topics, old.metadata) == (new.complete, new.topics, new.metadata)
        if not same or new.attachments != [*old.attachments, name]:
            raise RecordingError(f"{recording} {_DAMAGED}")


def _rewrite(
    old: BinaryIO, new: BinaryIO, attached: BinaryIO, size: int, labels: tuple[str, str, int]
) -> None:
    ending = _ending(old)
    old.seek(0)
    _copy(old, new, ending.data)
    name, media_type, stamp = labels
    checksum, length = _write_attachment(new, attached, size, labels, ending.checksum)
    if not ending.closed:
        return
    builder = RecordBuilder()
    DataEnd(checksum).write(builder)
    new.write(builder.end())
    if ending.summary:
        index = AttachmentIndex(ending.data, length, stamp, stamp, size, name, media_type)
        _write_summary(new, ending.summary, index)
    else:
        builder = RecordBuilder()
        Footer(0, 0, 0).write(builder)
        new.write(builder.end())
    new.write(_MAGIC)


def _ending(file: BinaryIO) -> _Ending:
    """Find the end of a recording's data, by the heads of its records."""
    size = file.seek(0, os.SEEK_END)
    at, data, checksum = len(_MAGIC), 0, 0
    summary: list[tuple[int, bytes]] = []
    for opcode, begin, end in _records(file, at, size):
        if opcode == Opcode.FOOTER:
            closed = end + len(_MAGIC) == size
            return _Ending(data or begin, checksum, summary, closed and bool(data))
        if opcode == Opcode.DATA_END:
            data = begin
            checksum = DataEnd.read(_body(file, begin, end)).data_section_crc
        elif data and opcode != Opcode.SUMMARY_OFFSET:
            file.seek(begin)
            summary.append((opcode, file.read(end - begin)))
        at = end
    return _Ending(data or at, checksum, summary, closed=False)


def _records(file: BinaryIO, at: int, size: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of each whole record."""
    while at + _HEAD.size <= size:
        file.seek(at)
        opcode, length = _HEAD.unpack(file.read(_HEAD.size))
        end = at + _HEAD.size + length
        # There is no opcode 0: a machine that lost power may leave gigabytes of zeros.
        if end > size or opcode == 0:
            return
        yield opcode, at, end
        at = end


def _body(file: BinaryIO, begin: int, end: int) -> ReadDataStream:
    file.seek(begin + _HEAD.size)
    return ReadDataStream(BytesIO(file.read(end - begin - _HEAD.size)))


def _write_attachment(
    new: BinaryIO, attached: BinaryIO, size: int, labels: tuple[str, str, int], checksum: int
) -> tuple[int, int]:
    """Write the record; returns the checksum of all data with it, 0 for none, and its length."""
    name, media_type, stamp = labels
    builder = RecordBuilder()
    builder.write8(stamp)
    builder.write8(stamp)
    builder.write_prefixed_string(name)
    builder.write_prefixed_string(media_type)
    builder.write8(size)
    fields = builder.end()
    head = _HEAD.pack(Opcode.ATTACHMENT, len(fields) + size + 4)
    own, whole = zlib.crc32(fields), zlib.crc32(head + fields, checksum)
    new.write(head + fields)
    left = size
    while left and (block := attached.read(min(_BLOCK, left))):
        new.write(block)
        own, whole = zlib.crc32(block, own), zlib.crc32(block, whole)
        left -= len(block)
    if left:
        raise OSError(0, "the file became shorter meanwhile")
    end = struct.pack("<I", own)
    new.write(end)
    return zlib.crc32(end, whole) if checksum else 0, len(head) + len(fields) + size + 4


def _write_summary(new: BinaryIO, summary: list[tuple[int, bytes]], added: AttachmentIndex) -> None:
    """Write a summary with one more attachment, its records in groups, and the footer."""
    builder = RecordBuilder()
    added.write(builder)
    groups: dict[int, list[bytes]] = {}
    for opcode, record in summary:
        groups.setdefault(opcode, []).append(
            _counted(record) if opcode == Opcode.STATISTICS else record
        )
    groups.setdefault(Opcode.ATTACHMENT_INDEX, []).append(builder.end())
    begin = new.tell()
    content = bytearray()
    offsets = RecordBuilder()
    for opcode, records in groups.items():
        start = begin + len(content)
        content += b"".join(records)
        SummaryOffset(opcode, start, begin + len(content) - start).write(offsets)
    offset_start = begin + len(content)
    content += offsets.end()
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, begin, offset_start)
    content += footer
    new.write(content)
    new.write(struct.pack("<I", zlib.crc32(content)))


def _counted(record: bytes) -> bytes:
    """Statistics of one attachment more."""
    told = Statistics.read(ReadDataStream(BytesIO(record[_HEAD.size :])))
    told.attachment_count += 1
    builder = RecordBuilder()
    told.write(builder)
    counted: bytes = builder.end()
    return counted


def _copy(old: BinaryIO, new: BinaryIO, size: int) -> None:
    left = size
    while left and (block := old.read(min(_BLOCK, left))):
        new.write(block)
        left -= len(block)
    if left:
        raise OSError(0, "the recording became shorter meanwhile")


def _sync_folder(folder: Path) -> None:
    """Wait until the new name is on the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
