"""Reader of ROS 2 bags, in MCAP and SQLite storage: a folder, or one of its files."""

from __future__ import annotations

import heapq
import re
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Protocol

from typing_extensions import Self

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import RecordingError
from aerodaas.recording.reader import Recording, Topic
from aerodaas.recording.ros.sqlite_part import SqlitePart
from aerodaas.recording.steady_clock import SteadyClock

__all__ = ["BagMessage", "RosBag"]

_MAX_FILES = 1000
"""Files of a bag; rosbag2 splits by size or duration."""
_CLOCKS_SET_SINCE = 946_684_800 * NANOSECONDS
"""The year 2000: a clock before it has not been set."""


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
