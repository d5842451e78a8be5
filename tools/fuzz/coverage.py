"""Tells which inputs reach lines of the product that none before has reached."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import aerodaas

__all__ = ["Coverage"]

_OURS = f"{Path(aerodaas.__file__).parent}/"


class Coverage:
    """Lines reached so far, by the interpreter's trace hook, in this thread and our own files.

    Other code runs at full speed, so that it costs a tenth where most work is a library's.
    """

    def __init__(self) -> None:
        self._lines: set[tuple[CodeType, int]] = set()
        self._ours: dict[CodeType, bool] = {}
        self._before = 0

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Note the lines that the block reaches."""
        self._before = len(self._lines)
        sys.settrace(self._call)
        try:
            yield
        finally:
            sys.settrace(None)

    @property
    def grew(self) -> bool:
        """Whether the last block reached a new line."""
        return len(self._lines) > self._before

    def _call(self, frame: FrameType, _event: str, _argument: Any) -> Any:  # noqa: ANN401
        code = frame.f_code
        ours = self._ours.get(code)
        if ours is None:
            ours = self._ours[code] = code.co_filename.startswith(_OURS)
        return self._line if ours else None

    def _line(self, frame: FrameType, event: str, _argument: Any) -> Any:  # noqa: ANN401
        if event == "line":
            self._lines.add((frame.f_code, frame.f_lineno))
        return self._line
