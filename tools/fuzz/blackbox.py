"""The input that a process is at, in a file that outlives it."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path

from tools.fuzz.mutation import LARGEST

__all__ = ["BlackBox"]

_HEAD = struct.Struct("<QQQ")
_SIZE = _HEAD.size + 16 * LARGEST


class BlackBox:
    """Written by a worker before each input, read by the one who watches it."""

    def __init__(self, path: Path) -> None:
        """Open the box at `path`; the first to open it makes it."""
        with path.open("a+b") as file:
            file.truncate(_SIZE)
            self._map = mmap.mmap(file.fileno(), _SIZE)

    def record(self, number: int, data: bytes) -> None:
        """Note that input `number` comes next.

        Raises:
            ValueError: If the input is larger than the box.
        """
        if len(data) > _SIZE - _HEAD.size:
            raise ValueError(f"an input of {len(data)} bytes; at most {_SIZE - _HEAD.size}")
        steps = _HEAD.unpack_from(self._map)[0]
        self._map[_HEAD.size : _HEAD.size + len(data)] = data
        _HEAD.pack_into(self._map, 0, steps + 1, number, len(data))

    def read(self) -> tuple[int, int, bytes]:
        """Runs so far, number of the input, the input."""
        steps, number, length = _HEAD.unpack_from(self._map)
        return steps, number, self._map[_HEAD.size : _HEAD.size + length]

    @property
    def steps(self) -> int:
        """Runs so far."""
        return int(_HEAD.unpack_from(self._map)[0])

    def close(self) -> None:
        """Let go of the file."""
        self._map.close()
