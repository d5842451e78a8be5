"""Reader of ROS 2 bags in MCAP storage, within the bounds of any recording."""

from __future__ import annotations

import heapq
import re
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from typing_extensions import Self

from aerodaas.errors import RecordingError
from aerodaas.recording.reader import Recording, Topic

__all__ = ["BagMessage", "RosBag"]

_MAX_FILES = 1000
"""Files of a bag; rosbag2 splits by size or duration."""


class BagMessage(NamedTuple):
    """One message of a bag."""

    time: int
    """When it was recorded, nanoseconds since 1970."""
    topic: str
    value: Any
    """The decoded message, with the fields of its type."""


class RosBag:
    """An open bag. Of its `metadata.yaml` nothing is needed: the files say the same themselves."""

    def __init__(self, path: Path, parts: list[Recording]) -> None:
        """Wrap open files; use `RosBag.open`."""
        self.path = path
        self._parts = parts

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Open a bag.

        Args:
            path: Its folder, or one `.mcap` file.

        Returns:
            The bag, to be closed with `close` or a `with` block.

        Raises:
            RecordingError: If it is none, is stored otherwise, is compressed as a file, or cannot
                be read.
        """
        path = Path(path)
        files = [path]
        if path.is_dir():
            files = sorted(path.glob("*.mcap"), key=_numbered)
            packed = next(path.glob("*.zstd"), None)
            if packed is not None:
                raise RecordingError(f"{packed} is compressed; unpack it first: unzstd {packed}")
            if not files and any(path.glob("*.db3")):
                raise _no_mcap(path)
        if not files or len(files) > _MAX_FILES:
            raise RecordingError(
                f"{path} holds {len(files)} .mcap files; a bag has 1 to {_MAX_FILES}"
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

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Iterate over the messages of `topics` in the order of their times.

        A message that cannot be decoded is skipped and counted in `damaged`.

        Raises:
            ConfigError: If the extra `ros` is not installed.
        """
        return heapq.merge(
            *(_messages(part, topics) for part in self._parts), key=lambda one: one.time
        )

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


def _messages(part: Recording, topics: Collection[str]) -> Iterator[BagMessage]:
    for record in part.records(topics=topics):
        yield BagMessage(record.stamp + part.epoch_ns, record.topic, record.value)


def _numbered(path: Path) -> list[tuple[int, str]]:
    """Sorts bag_2 before bag_10."""
    return [(int(number or -1), word) for word, number in re.findall(r"(\D*)(\d*)", path.name)]


def _opened(path: Path, stack: ExitStack) -> Recording:
    """Open one file, which `stack` closes if another fails."""
    try:
        with path.open("rb") as file:
            head = file.read(16)
    except OSError as error:
        raise RecordingError(f"cannot open the bag {path}: {error.strerror}") from None
    if not head.startswith(b"\x89MCAP"):
        raise _no_mcap(path)
    part = Recording.open(path)
    stack.callback(part.close)
    return part


def _no_mcap(path: Path) -> RecordingError:
    return RecordingError(
        f"{path} is not in MCAP storage; make such a bag of it, be it in SQLite (.db3) or of "
        f"ROS 1 (.bag): rosbags-convert --src {path} --dst {path.with_suffix('')}_mcap "
        "--dst-storage mcap"
    )
