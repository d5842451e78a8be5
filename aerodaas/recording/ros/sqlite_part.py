"""Reader of one SQLite file of a ROS 2 bag, within bounds whoever made it.

A database is a stranger's: a view or a computed column in place of a table would run for ever, and
pages that point at each other hold more than the file. So only plain tables are read, rows are
counted by the work that they cause, and bytes by what they sum up to.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import quote

import zstandard

from aerodaas.errors import AeroDaaSError, RecordingError
from aerodaas.recording.decoding.limits import MAX_CHANNELS, MAX_CHUNK, MAX_RATIO, MAX_UNPACKED
from aerodaas.recording.reader import Topic
from aerodaas.recording.ros.typestore import ROS_TYPES, ros_decoder

__all__ = ["SqlitePart"]

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
        """Time (nanoseconds since 1970), topic and decoded message; broken ones are counted.

        They come in the order of their times, or `as_written`.
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
