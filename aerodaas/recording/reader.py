"""Reader of MCAP recordings, complete or cut off, of this project or another."""

from __future__ import annotations

import heapq
from collections import Counter, OrderedDict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.records import Attachment, Channel, Message
from typing_extensions import Self

from aerodaas.clock import seconds
from aerodaas.errors import RecordingError
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.decoding.index import (
    BROKEN,
    Block,
    FileIndex,
    TooLargeError,
    load,
    read_index,
)
from aerodaas.recording.decoding.limits import MAX_ATTACHMENT, MAX_HELD
from aerodaas.recording.decoding.messages import BrokenMessageError, MessageDecoder
from aerodaas.recording.messages import NO_LABELS, Labels

__all__ = ["Record", "Recording", "Topic", "vehicle_states"]

_RECORD_HEAD = 9
_STAMP = 8
_CHECKSUM = 4
_BLOCK = 1 << 20
_LATEST = 1 << 63
"""Nanoseconds since 1970 that a date can show: until the year 2262."""
_NEVER = 1 << 64
"""Later than any log time."""
_KEPT_BLOCKS = 4
_KEPT_SIZE = 4 << 20
"""Bytes of a block that is kept; ours have one million."""
_OVERHEAD = 256
"""Bytes in memory of a message, beside its data."""


@dataclass(frozen=True, slots=True)
class Topic:
    """One channel of a recording."""

    name: str
    schema: str
    """Name of the schema, such as `foxglove.CompressedImage`; empty for none."""
    encoding: str
    """`json`, `protobuf`, `cdr`, …"""
    count: int
    """Number of messages in the file."""


@dataclass(frozen=True, slots=True)
class Record:
    """One message of a recording."""

    topic: str
    schema: str
    stamp: int
    """Mission time at which it was recorded, nanoseconds."""
    captured: int
    """Mission time of the described measurement, nanoseconds."""
    sequence: int
    value: Any
    """A message of the class that `messages.CHANNELS` has for the schema; a dictionary for other
    JSON, an object for protobuf and the ROS 2 types that are known, else bytes; None where it was
    not to be decoded."""
    labels: Labels = NO_LABELS
    """What a message of this project says beside its own fields."""


class Recording:
    """An open MCAP file; the readable part of a cut-off or damaged one, the rest counted."""

    def __init__(self, path: Path, file: BinaryIO, index: FileIndex) -> None:
        """Wrap an open file; use `Recording.open`."""
        self.path = path
        self._file = file
        self._index = index
        self._loaded: OrderedDict[int, list[Message]] = OrderedDict()
        """Messages of the blocks read last, by offset: who seeks reads the same ones again."""
        self.skipped: Counter[str] = Counter()
        """Broken messages that were skipped so far, by topic; counted at each reading."""
        starts = [block.start for block in index.blocks]
        self.metadata: dict[str, dict[str, str]] = {
            record.name: record.metadata for record in index.metadata
        }
        """Metadata records by name; `aerodaas` holds the provenance."""
        self._decoder = MessageDecoder(self.provenance.get("format", ""))
        try:
            self.epoch_ns = int(self.provenance["epoch_ns"])
        except (KeyError, ValueError):
            self.epoch_ns = -1
        if not 0 <= self.epoch_ns < _LATEST:
            self.epoch_ns = min(starts, default=0)

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Open a recording.

        Args:
            path: The MCAP file.

        Returns:
            The recording, to be closed with `close` or a `with` block.

        Raises:
            RecordingError: If the file is no MCAP recording or cannot be read.
        """
        path = Path(path)
        if path.is_dir():
            raise RecordingError(f"{path} is a folder{_recordings_in(path)}")
        try:
            size = path.stat().st_size
            file = path.open("rb")
        except OSError as error:
            raise RecordingError(f"cannot open the recording {path}: {error.strerror}") from None
        try:
            return cls(path, file, read_index(file, size))
        except (*BROKEN, OSError) as error:
            file.close()
            if size == 0:
                raise RecordingError(f"{path} is empty: nothing was recorded") from None
            if isinstance(error, OSError):
                raise RecordingError(f"cannot read {path}: {error.strerror}") from None
            if isinstance(error, TooLargeError):
                raise RecordingError(f"{path} {error}") from None
            raise RecordingError(
                f"{path} is not an MCAP recording; give the .mcap file that a run has written"
            ) from None

    @property
    def complete(self) -> bool:
        """Whether the file was closed properly."""
        return self._index.complete

    @property
    def damaged(self) -> int:
        """Number of chunks and messages that could not be read so far."""
        return self._index.damaged + self.skipped.total()

    @property
    def provenance(self) -> Mapping[str, str]:
        """Versions, seed and application as in `Provenance.as_metadata`; empty if not recorded."""
        return self.metadata.get("aerodaas", {})

    @property
    def topics(self) -> dict[str, Topic]:
        """Channels by topic."""
        index = self._index
        return {
            channel.topic: Topic(
                channel.topic,
                self._schema_name(channel),
                channel.message_encoding,
                index.counts[number],
            )
            for number, channel in index.channels.items()
        }

    @property
    def duration(self) -> float:
        """Seconds from the first message to the last."""
        blocks = self._index.blocks
        if not blocks:
            return 0.0
        return seconds(max(block.end for block in blocks) - min(block.start for block in blocks))

    @property
    def attachments(self) -> list[str]:
        """Names of the attachments."""
        return list(self._index.attachments)

    def attachment(self, name: str) -> bytes:
        """Contents of an attachment.

        Args:
            name: One of `attachments`.

        Raises:
            RecordingError: If the attachment does not exist or is damaged.
        """
        length = self._seek_attachment(name, MAX_ATTACHMENT)
        body = BytesIO(self._file.read(length))
        try:
            data: bytes = Attachment.read(ReadDataStream(body)).data
        except BROKEN:
            raise RecordingError(f"the attachment {name!r} of {self.path} is damaged") from None
        return data

    def extract(self, name: str, file: Path, most: int) -> None:
        """Write the contents of an attachment to a file, block by block.

        Args:
            name: Name of the attachment.
            file: The file.
            most: Bytes of the largest attachment that is written.

        Raises:
            RecordingError: If the attachment does not exist, is larger or is damaged; the file is
                then of no use.
            OSError: If the file cannot be written.
        """
        left = self._seek_attachment(name, most)
        try:
            stream = ReadDataStream(self._file, calculate_crc=True)
            stream.read(2 * _STAMP)
            for _ in ("name", "media type"):
                stream.read_prefixed_string()
            size = stream.read8()
            if stream.count + size + _CHECKSUM != left:
                raise ValueError("an attachment and the file's index differ in its size")
            with file.open("wb") as output:
                while size:
                    size -= output.write(stream.read(min(size, _BLOCK)))
            found = stream.checksum()
            if stream.read4() not in {0, found}:
                raise ValueError("the checksum of an attachment does not match")
        except BROKEN:
            raise RecordingError(f"the attachment {name!r} of {self.path} is damaged") from None

    def _seek_attachment(self, name: str, most: int) -> int:
        """Go to the body of an attachment's record; returns its length."""
        if name not in self._index.attachments:
            known = ", ".join(self._index.attachments) or "none"
            raise RecordingError(f"{self.path} has no attachment {name!r}; it has: {known}")
        offset, length = self._index.attachments[name]
        if length > most:
            raise RecordingError(
                f"the attachment {name!r} of {self.path} has {length} bytes, more than the "
                f"{most} that are read"
            )
        self._file.seek(offset + _RECORD_HEAD)
        return length - _RECORD_HEAD

    def records(
        self,
        *,
        schemas: Collection[str] | None = None,
        topics: Collection[str] | None = None,
        bare: Collection[str] = (),
        since: int | None = None,
        until: int | None = None,
        as_written: bool = False,
        as_json: bool = False,
    ) -> Iterator[Record]:
        """Iterate over messages in the order of log times.

        Chunks that overlap in time are put in order as far as `limits.MAX_HELD` allows. Chunks
        outside of the given time are not read. A message without a time of publishing was captured
        when it was recorded.

        Args:
            schemas: Names of the schemas to read; None for all.
            topics: Topics to read; None for all.
            bare: Topics whose messages are not decoded: their value is None.
            since: Earliest mission time of recording, nanoseconds; None for the first message's.
            until: Latest one; None for the last message's.
            as_written: In the order of the file instead, as a clock that was set back asks for.
            as_json: Messages of this project as the JSON values that were recorded.

        Yields:
            Messages, checked by `messages.MessageDecoder`; a damaged chunk or a broken message is
            skipped and counted in `damaged`.
        """
        wanted = {
            number
            for number, channel in self._index.channels.items()
            if (topics is None or channel.topic in topics)
            and (schemas is None or self._schema_name(channel) in schemas)
        }
        first = 0 if since is None else since + self.epoch_ns
        last = _NEVER if until is None else until + self.epoch_ns
        is_ours = bool(self.provenance)
        for message in self._messages(wanted, first, last, as_written=as_written):
            channel = self._index.channels[message.channel_id]
            schema = self._index.schemas.get(channel.schema_id)
            value, labels = None, NO_LABELS
            try:
                if channel.topic not in bare:
                    labels, value = self._decoder.decode(
                        channel, schema, message.data, as_json=as_json
                    )
            except BrokenMessageError:
                self.skipped[channel.topic] += 1
                continue
            yield Record(
                channel.topic,
                self._schema_name(channel),
                message.log_time - self.epoch_ns,
                (message.publish_time if is_ours else message.publish_time or message.log_time)
                - self.epoch_ns,
                message.sequence,
                value,
                labels,
            )

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _schema_name(self, channel: Channel) -> str:
        schema = self._index.schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def _messages(
        self, wanted: set[int], first: int, last: int, *, as_written: bool
    ) -> Iterator[Message]:
        blocks = [
            block
            for block in self._index.blocks
            if block.channels & wanted and block.start <= last and block.end >= first
        ]
        if as_written:
            for block in sorted(blocks, key=lambda block: block.offset):
                for message in self._load(block):
                    if message.channel_id in wanted and first <= message.log_time <= last:
                        yield message
            return
        blocks.sort(key=lambda block: block.start)
        # Chunks may overlap in time: hold messages back until no later chunk can precede them.
        held: list[tuple[int, int, Message]] = []
        order = size = 0
        for position, block in enumerate(blocks):
            for message in self._load(block):
                if message.channel_id in wanted and first <= message.log_time <= last:
                    heapq.heappush(held, (message.log_time, order, message))
                    order += 1
                    size += len(message.data) + _OVERHEAD
                    while size > MAX_HELD and held:
                        size -= len(held[0][2].data) + _OVERHEAD
                        yield heapq.heappop(held)[2]
            following = blocks[position + 1].start if position + 1 < len(blocks) else None
            while held and (following is None or held[0][0] < following):
                size -= len(held[0][2].data) + _OVERHEAD
                yield heapq.heappop(held)[2]

    def _load(self, block: Block) -> Iterator[Message]:
        known = self._loaded.get(block.offset)
        if known is not None:
            yield from known
            return
        kept = max(block.size, block.length) <= _KEPT_SIZE
        messages: list[Message] = []
        try:
            for record in load(self._file, block):
                if isinstance(record, Message):
                    if kept:
                        messages.append(record)
                    yield record
        except BROKEN:
            self._index.damaged += not block.damaged
            block.damaged = True
            return
        if kept:
            self._loaded[block.offset] = messages
            while len(self._loaded) > _KEPT_BLOCKS:
                self._loaded.popitem(last=False)


def vehicle_states(recording: Recording, robot: str) -> Iterator[tuple[int, VehicleState]]:
    """Iterate over a robot's states in the order of recording.

    Args:
        recording: An open recording.
        robot: Id of the robot.

    Yields:
        Mission time of publishing, nanoseconds, and the state.
    """
    for record in recording.records(schemas=("aerodaas.VehicleState",)):
        if record.labels.robot == robot:
            yield record.stamp, record.value


def _recordings_in(folder: Path) -> str:
    """Say which recording of a folder may be meant."""
    found = [one for one in folder.glob("*.mcap") if one.is_file()]
    if not found:
        return " without recordings"
    newest = max(found, key=lambda one: one.stat().st_mtime)
    more = f"; {len(found) - 1} more are there" if len(found) > 1 else ""
    return f": give a recording, such as its newest, {newest}{more}"
