"""Reader of ROS 2 bags, in MCAP and SQLite storage: a folder, or one of its files.

A database is a stranger's: a view or a computed column in place of a table would run for ever, and
pages that point at each other hold more than the file. So only plain tables are read, rows are
counted by the work that they cause, and bytes by what they sum up to.
"""

from __future__ import annotations

import heapq
import re
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from functools import cached_property
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Protocol
from urllib.parse import quote

import zstandard
from typing_extensions import Self

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import AeroDaaSError, RecordingError
from aerodaas.extensions.ros2.bags.typestore import ROS_TYPES, ros_decoder
from aerodaas.recording.decoding.limits import MAX_CHANNELS, MAX_CHUNK, MAX_RATIO, MAX_UNPACKED
from aerodaas.recording.reader import Recording, Topic
from aerodaas.recording.steady_clock import SteadyClock

__all__ = ["BagMessage", "RosBag"]

_COLUMNS = {
    "topics": {"id", "name", "type", "serialization_format"},
    "messages": {"id", "topic_id", "timestamp", "data"},
}
_STEPS = 10_000
"""Instructions of SQLite's machine between two looks at how many it was."""
_STEPS_A_BYTE = 100
"""Instructions for each byte of the file, and `_STEPS_AT_LEAST`: a row takes some ten bytes and
some dozens of instructions."""
_STEPS_AT_LEAST = 50_000_000
_ROWS_BY_TIME = "SELECT id, topic_id, timestamp, length(data) FROM messages ORDER BY timestamp"
"""Without their data, which would be sorted along where there is no index."""
_ROWS_AS_WRITTEN = "SELECT id, topic_id, timestamp, length(data) FROM messages ORDER BY id"
_LATEST = 1 << 63
"""Nanoseconds since 1970, exclusive."""
_LONGEST_NAME = 4096
_ZSTD = b"\x28\xb5\x2f\xfd"
"""Begins a message that rosbag2 compressed by itself; CDR begins with a zero."""
_MAX_FILES = 1000
"""Files of a bag; rosbag2 splits by size or duration."""
_CLOCKS_SET_SINCE = 946_684_800 * NANOSECONDS
"""The year 2000: a clock before it has not been set."""


class SqlitePart:
    """One `.db3` file: topics, and messages in the order of their time."""

    def __init__(self, path: Path) -> None:
        """Open the file; raises RecordingError for one that is no bag, or not within bounds."""
        self.damaged = 0
        self._is_cut = False
        self._path = path
        self._size = path.stat().st_size
        self._steps = 0
        self._left = 0
        """Bytes that may still be read."""
        self._database = sqlite3.connect(
            f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1", uri=True
        )
        self._database.text_factory = lambda data: data.decode("utf-8", "replace")
        self._database.set_progress_handler(self._too_long, _STEPS)
        try:
            self._database.execute("PRAGMA trusted_schema = OFF")
            self._require_tables()
            self._topics = self._read_topics()
        except sqlite3.Error as error:
            self.close()
            raise RecordingError(
                f"{path} is no SQLite file of a ROS 2 bag, or was cut off ({error}); what is "
                f"left of it: sqlite3 {path.name} .recover | sqlite3 recovered.db3"
            ) from None
        except RecordingError:
            self.close()
            raise

    @property
    def topics(self) -> dict[str, Topic]:
        """Topics by name."""
        return {topic.name: topic for topic in self._topics.values()}

    @property
    def complete(self) -> bool:
        """Whether it was read without an end that is missing."""
        return not self._is_cut

    def times(self) -> Iterator[tuple[int, str]]:
        """Time (nanoseconds since 1970) and topic of each message as it was written."""
        try:
            for number, time in self._database.execute(
                "SELECT topic_id, timestamp FROM messages ORDER BY id"
            ):
                if number in self._topics and isinstance(time, int) and 0 <= time < _LATEST:
                    yield time, self._topics[number].name
        except sqlite3.Error:
            self._is_cut = True

    def messages(
        self, topics: Collection[str], *, as_written: bool
    ) -> Iterator[tuple[int, str, Any]]:
        """Read messages; broken ones are counted.

        Args:
            topics: Names of the topics to read.
            as_written: Keep the order of writing; if False, messages come by their times.

        Yields:
            Time (nanoseconds since 1970), topic and decoded message.
        """
        wanted = {number: topic for number, topic in self._topics.items() if topic.name in topics}
        decoders = {
            number: ros_decoder(topic.schema)
            for number, topic in wanted.items()
            if topic.schema in ROS_TYPES
        }
        self._left = self._size * MAX_RATIO + MAX_UNPACKED
        try:
            rows = self._database.execute(_ROWS_AS_WRITTEN if as_written else _ROWS_BY_TIME)
            for row, number, time, length in rows:
                if number not in decoders:
                    continue
                whole = isinstance(time, int) and 0 <= time < _LATEST and isinstance(length, int)
                if not whole or length > MAX_CHUNK:
                    self.damaged += 1
                    continue
                try:
                    value = decoders[number](self._data(row))
                except (AeroDaaSError, sqlite3.Error):
                    raise
                except Exception:  # noqa: BLE001 - the decoder raises whatever it stumbles over
                    self.damaged += 1
                    continue
                yield time, wanted[number].name, value
        except sqlite3.Error:
            # Cut off, or damaged from here on.
            self._is_cut = True
            self.damaged += 1

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def _data(self, row: int) -> bytes:
        found = self._database.execute("SELECT data FROM messages WHERE id = ?", (row,)).fetchone()
        data = found[0] if found else None
        if not isinstance(data, bytes):
            raise ValueError("no data")  # noqa: TRY004 - a broken message, not a wrong argument
        if data.startswith(_ZSTD):
            reader = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK).stream_reader(
                BytesIO(data)
            )
            data = reader.read(MAX_CHUNK)
        self._left -= len(data)
        if self._left < 0:
            raise RecordingError(f"{self._path} unpacks to more than {MAX_RATIO} times its size")
        return data

    def _require_tables(self) -> None:
        for table, columns in _COLUMNS.items():
            kind = self._database.execute(
                "SELECT type, sql FROM sqlite_master WHERE name = ?", (table,)
            ).fetchone()
            described = self._database.execute(f"PRAGMA table_xinfo({table})").fetchall()
            plain = {name for _, name, _, _, _, _, hidden in described if hidden == 0}
            virtual = kind is not None and "virtual" in str(kind[1]).lower().split()[:2]
            if kind is None or kind[0] != "table" or virtual or not columns <= plain:
                raise RecordingError(
                    f"{self._path} is no SQLite file of a ROS 2 bag: it has no plain table "
                    f"{table!r} with {', '.join(sorted(columns))}"
                )

    def _read_topics(self) -> dict[int, Topic]:
        counts = dict(
            self._database.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id")
        )
        rows = self._database.execute(
            "SELECT id, name, type, serialization_format FROM topics LIMIT ?", (MAX_CHANNELS + 1,)
        ).fetchall()
        if len(rows) > MAX_CHANNELS:
            raise RecordingError(f"{self._path} has more than {MAX_CHANNELS} topics")
        topics = {}
        for number, *words in rows:
            name, kind, encoding = (str(word)[:_LONGEST_NAME] for word in words)
            if isinstance(number, int):
                topics[number] = Topic(name, kind, encoding, counts.get(number, 0))
        return topics

    def _too_long(self) -> bool:
        """Whether SQLite has worked longer than a whole file of this size asks for."""
        self._steps += _STEPS
        return self._steps > self._size * _STEPS_A_BYTE + _STEPS_AT_LEAST


class BagMessage(NamedTuple):
    """One message of a bag."""

    time: int
    """When it was recorded, nanoseconds since 1970, without leaps of the clock."""
    topic: str
    value: Any
    """The decoded message, with the fields of its type."""
    shift: int = 0
    """Nanoseconds that `time` has more than the file."""


class _Part(Protocol):
    @property
    def topics(self) -> dict[str, Topic]: ...
    @property
    def damaged(self) -> int: ...
    @property
    def complete(self) -> bool: ...
    def times(self) -> Iterator[tuple[int, str]]: ...
    def messages(
        self, topics: Collection[str], *, as_written: bool
    ) -> Iterator[tuple[int, str, Any]]: ...
    def close(self) -> None: ...


class RosBag:
    """An open bag. Of its `metadata.yaml` nothing is needed: the files say the same themselves."""

    def __init__(self, path: Path, parts: list[_Part]) -> None:
        """Wrap open files; use `RosBag.open`."""
        self.path = path
        self._parts = parts

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Open a bag.

        Args:
            path: Its folder, or one `.mcap` or `.db3` file.

        Returns:
            The bag, to be closed with `close` or a `with` block.

        Raises:
            RecordingError: If it is none, is compressed as a file, or cannot be read.
        """
        path = Path(path)
        files = [path]
        if path.is_dir():
            files = [one for one in path.iterdir() if one.suffix in {".mcap", ".db3"}]
            files.sort(key=_numbered)
            packed = next((one for one in path.iterdir() if one.suffix == ".zstd"), None)
            if packed is not None:
                raise RecordingError(f"{packed} is compressed; unpack it first: unzstd {packed}")
        if not files or len(files) > _MAX_FILES:
            raise RecordingError(
                f"{path} holds {len(files)} .mcap and .db3 files; a bag has 1 to {_MAX_FILES}"
            )
        with ExitStack() as stack:
            parts = [_opened(file, stack) for file in files]
            stack.pop_all()
        return cls(path, parts)

    @property
    def topics(self) -> dict[str, Topic]:
        """Topics by name, counted over all files."""
        found: dict[str, Topic] = {}
        for part in self._parts:
            for name, topic in part.topics.items():
                before = found.get(name)
                count = topic.count + (before.count if before else 0)
                found[name] = Topic(name, topic.schema, topic.encoding, count)
        return found

    @property
    def damaged(self) -> int:
        """Number of messages and chunks that could not be read so far."""
        return sum(part.damaged for part in self._parts)

    @property
    def complete(self) -> bool:
        """Whether all files were closed properly; what follows in one that was not is lost."""
        return all(part.complete for part in self._parts)

    @property
    def leaps(self) -> int:
        """How often the bag's clock was set while a file was recorded."""
        return self._leaps_and_shift[0]

    @cached_property
    def _leaps_and_shift(self) -> tuple[int, int]:
        """How often the clock was set, and by how many nanoseconds it differs in the end."""
        leaps, whole = 0, SteadyClock()
        for part in self._parts:
            # The names of files need not be in order.
            own = SteadyClock()
            for time, topic in part.times():
                own.steady(time, topic)
                whole.steady(time, topic)
            leaps += own.leaps
        return leaps, whole.shift

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Iterate over the messages of `topics` in the order of their times.

        A message that cannot be decoded is skipped and counted in `damaged`. Where the clock was
        set meanwhile, messages come as they were written, and times go on without the leap; where
        it had not been set at all at first, they are by the clock at the end.

        Raises:
            ConfigError: If the extra `ros` is not installed.
        """
        leaps, shift = self._leaps_and_shift
        if not leaps:
            found = heapq.merge(
                *(part.messages(topics, as_written=False) for part in self._parts),
                key=lambda one: one[0],
            )
            yield from (BagMessage(*one) for one in found)
            return
        begins = next(time for part in self._parts for time, _ in part.times())
        clock = SteadyClock(-shift if begins < _CLOCKS_SET_SINCE else 0)
        for part in self._parts:
            for time, topic, value in part.messages(topics, as_written=True):
                steady = clock.steady(time, topic)
                yield BagMessage(steady, topic, value, clock.shift)

    def close(self) -> None:
        """Close its files."""
        for part in self._parts:
            part.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class _McapPart:
    """One MCAP file, read as any recording: within the same bounds."""

    def __init__(self, path: Path) -> None:
        self._recording = Recording.open(path)

    @property
    def topics(self) -> dict[str, Topic]:
        return self._recording.topics

    @property
    def damaged(self) -> int:
        return self._recording.damaged

    @property
    def complete(self) -> bool:
        return self._recording.complete

    def times(self) -> Iterator[tuple[int, str]]:
        for record in self._recording.records(bare=self.topics, as_written=True):
            yield record.stamp + self._recording.epoch_ns, record.topic

    def messages(
        self, topics: Collection[str], *, as_written: bool
    ) -> Iterator[tuple[int, str, Any]]:
        for record in self._recording.records(topics=topics, as_written=as_written):
            yield record.stamp + self._recording.epoch_ns, record.topic, record.value

    def close(self) -> None:
        self._recording.close()


def _numbered(path: Path) -> list[tuple[int, str]]:
    """Sorts bag_2 before bag_10."""
    return [(int(number or -1), word) for word, number in re.findall(r"(\D*)(\d*)", path.name)]


def _opened(path: Path, stack: ExitStack) -> _Part:
    """Open one file, which `stack` closes if another fails."""
    try:
        with path.open("rb") as file:
            head = file.read(16)
    except OSError as error:
        raise RecordingError(f"cannot open the bag {path}: {error.strerror}") from None
    if head.startswith(b"SQLite format 3"):
        part: _Part = SqlitePart(path)
    elif head.startswith(b"\x89MCAP"):
        part = _McapPart(path)
    else:
        raise RecordingError(
            f"{path} is neither MCAP nor SQLite; give a bag of ROS 2: its folder, or its .mcap or "
            ".db3 file (a .bag of ROS 1 becomes one by rosbags-convert)"
        )
    stack.callback(part.close)
    return part
