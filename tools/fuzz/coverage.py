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
_PATIENCE = 64
"""Calls of a function without a new line after which only some of its calls are watched."""
_SHARE = 16
"""One call of so many is watched then."""
_WATCHED = ((4096, 16), (256, 4), (0, 1))
"""Inputs so far, and of how many inputs one is watched from then on."""


class Coverage:
    """Lines reached so far, by the interpreter's trace hook, in this thread and our own files.

    Other code runs at full speed. So do most inputs after the first ones, and most calls of a
    function that has shown nothing new for long: a flight's loops would otherwise take three times
    as long. What is watched depends on the inputs alone, so that the same seed makes the same
    inputs.
    """

    def __init__(self) -> None:
        # By identity: a code object's own hash takes longer than most of its lines. Each is kept
        # here, so that its identity stays its own.
        self._functions: dict[int, _Function] = {}
        self._grew = False
        self._inputs = 0

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Note the lines that the block reaches."""
        self._grew = False
        self._inputs += 1
        if self._inputs % next(share for inputs, share in _WATCHED if self._inputs > inputs):
            yield
            return
        sys.settrace(self._call)
        try:
            yield
        finally:
            sys.settrace(None)

    @property
    def grew(self) -> bool:
        """Whether the last block reached a new line."""
        return self._grew

    def _call(self, frame: FrameType, _event: str, _argument: Any) -> Any:  # noqa: ANN401
        code = frame.f_code
        function = self._functions.get(id(code))
        if function is None:
            function = self._functions[id(code)] = _Function(code, self._note)
        if not function.ours:
            return None
        function.idle += 1
        if function.idle > _PATIENCE and function.idle % _SHARE:
            return None
        return function.trace

    def _note(self) -> None:
        self._grew = True


class _Function:
    """The lines reached in one function."""

    def __init__(self, code: CodeType, note: Any) -> None:  # noqa: ANN401
        self.ours = code.co_filename.startswith(_OURS)
        self.idle = 0
        """Calls since the last new line."""
        self._code = code
        self._lines: set[int] = set()
        self._note = note

    def trace(self, frame: FrameType, event: str, _argument: Any) -> Any:  # noqa: ANN401
        """Note a line, as a local trace function."""
        if event == "line" and frame.f_lineno not in self._lines:
            self._lines.add(frame.f_lineno)
            self.idle = 0
            self._note()
        return self.trace
