"""Attaching a file to a recording that is finished, without touching what it holds.

MCAP (https://mcap.dev/spec) has attachments among its data and an index of them in the summary at
its end. The recording is written anew beside itself, its data copied byte by byte, and takes its
own place in one step: whatever interrupts that leaves the old one or the new one, whole.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import zlib
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import (
    Attachment,
    AttachmentIndex,
    DataEnd,
    Footer,
    McapRecord,
    SummaryOffset,
)
from mcap.stream_reader import StreamReader
from mcap.summary import Summary

from aerodaas.errors import RecordingError
from aerodaas.recording.decoding.index import BROKEN
from aerodaas.recording.reader import Recording

__all__ = ["attach_file"]

_MAGIC = b"\x89MCAP0\r\n"
_DATA_END_SIZE, _FOOTER_SIZE = 13, 29
"""Bytes of these records."""
_BLOCK = 1 << 20


def attach_file(recording: Path, file: Path, name: str, media_type: str, stamp: int) -> None:
    """Attach a file to a recording.

    Args:
        recording: The MCAP file.
        file: What to attach.
        name: Name of the attachment.
        media_type: Its media type.
        stamp: Nanoseconds since the Unix epoch at which it begins.

    Raises:
        RecordingError: If the recording has an attachment of this name, is still written or was
            cut off, or cannot be read or replaced; it is then as it was.
    """
    recording = recording.resolve()
    with Recording.open(recording) as opened:
        if name in opened.attachments:
            raise RecordingError(
                f"{recording} has {name} already; rename the file if it is another one"
            )
        if not opened.complete:
            raise RecordingError(
                f"{recording} is still being written, or was cut off: attach to it once the flight "
                "is over, or once `mcap recover` has made it whole"
            )
    part: Path | None = None
    try:
        before = recording.stat()
        part = _new_file_beside(recording)
        attachment = Attachment(stamp, stamp, name, media_type, file.read_bytes())
        with recording.open("rb") as old, part.open("wb") as new:
            _rewrite(old, new, attachment)
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


def _rewrite(old: BinaryIO, new: BinaryIO, attachment: Attachment) -> None:
    summary = SeekingReader(old).get_summary()
    old.seek(-(_FOOTER_SIZE + len(_MAGIC)), os.SEEK_END)
    footer = next(StreamReader(old, skip_magic=True).records)
    if summary is None or not isinstance(footer, Footer):
        raise RecordingError("the recording has no summary, without which nothing is attached")
    size = footer.summary_start - _DATA_END_SIZE
    old.seek(size)
    end = next(StreamReader(old, skip_magic=True).records)
    if not isinstance(end, DataEnd):
        raise RecordingError("the recording's data does not end before its summary")
    old.seek(0)
    new.writelines(old.read(min(_BLOCK, size - begin)) for begin in range(0, size, _BLOCK))
    record = _encoded(attachment)
    new.write(record)
    checksum = zlib.crc32(record, end.data_section_crc) if end.data_section_crc else 0
    new.write(_encoded(DataEnd(checksum)))
    summary.attachment_indexes.append(
        AttachmentIndex(
            size,
            len(record),
            attachment.log_time,
            attachment.create_time,
            len(attachment.data),
            attachment.name,
            attachment.media_type,
        )
    )
    if summary.statistics is not None:
        summary.statistics.attachment_count += 1
    new.write(_encoded_summary(summary, new.tell()))
    new.write(_MAGIC)


def _encoded_summary(summary: Summary, begin: int) -> bytes:
    """Records of a summary in groups, and the footer; `begin` is where they begin in the file."""
    groups: dict[Opcode, list[McapRecord]] = {
        Opcode.SCHEMA: [*summary.schemas.values()],
        Opcode.CHANNEL: [*summary.channels.values()],
        Opcode.STATISTICS: [] if summary.statistics is None else [summary.statistics],
        Opcode.CHUNK_INDEX: [*summary.chunk_indexes],
        Opcode.ATTACHMENT_INDEX: [*summary.attachment_indexes],
        Opcode.METADATA_INDEX: [*summary.metadata_indexes],
    }
    content, offsets = b"", b""
    for opcode, records in groups.items():
        group = b"".join(map(_encoded, records))
        if group:
            offsets += _encoded(SummaryOffset(opcode, begin + len(content), len(group)))
            content += group
    offset_start = begin + len(content)
    content += offsets
    # The checksum covers the footer, too, up to the checksum itself.
    head = _encoded(Footer(begin, offset_start, 0))[:-4]
    return content + _encoded(Footer(begin, offset_start, zlib.crc32(content + head)))


def _encoded(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    encoded: bytes = builder.end()
    return encoded


def _sync_folder(folder: Path) -> None:
    """Wait until the new name is on the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
