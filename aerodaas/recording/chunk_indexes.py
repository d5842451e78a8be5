"""Chunk indexes of a recording in progress: kept on disk until its summary is written."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

from mcap.data_stream import RecordBuilder
from mcap.writer import Writer

__all__ = ["keep_chunk_indexes_on_disk"]

_LIST = "_Writer__chunk_indices"
"""The writer's own list, for which it has no public name."""
_BLOCK = 1 << 16


class _Record(Protocol):
    def write(self, stream: RecordBuilder) -> None:
        """Append the record to `stream`."""
        ...


class _OnDisk:
    """The part of a list that the writer uses: `append` in flight, iteration at the end."""

    def __init__(self, folder: Path) -> None:
        # Without a name, so that a killed process leaves nothing behind.
        self._file: Any = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115

    def append(self, index: _Record) -> None:
        builder = RecordBuilder()
        index.write(builder)
        self._file.write(builder.end())

    def __iter__(self) -> Iterator[_Record]:
        yield self

    def write(self, stream: RecordBuilder) -> None:
        self._file.seek(0)
        while block := self._file.read(_BLOCK):
            stream.write(block)
        self._file.close()


def keep_chunk_indexes_on_disk(writer: Writer, folder: Path) -> None:
    """Make `writer` keep its chunk indexes in a nameless file in `folder`.

    Two chunks a second, each with the places of all its channels, are 15 to 40 MB of objects an
    hour. Where a release of the library has renamed its list, they stay in memory.
    """
    if hasattr(writer, _LIST):
        setattr(writer, _LIST, _OnDisk(folder))
