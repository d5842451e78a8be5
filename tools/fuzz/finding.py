"""Findings: an input that a target could not take, and how it failed."""

from __future__ import annotations

import hashlib
import re
import traceback
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

__all__ = ["Finding", "Kind", "by_exception", "by_fault"]

Kind = Literal["exception", "hang", "memory", "crash"]
_HARNESS = {str(Path(__file__).parent / name) for name in ("worker.py", "coverage.py")}
_FRAME = re.compile(r'File "(.+?)", line (\d+) in (\S+)')
_REPEATED = 3
"""Times that a line is in a traceback from which on it is part of a recursion."""


@dataclass(frozen=True)
class Finding:
    """An input that failed, once for each way of failing."""

    kind: Kind
    signature: str
    """Equal for equal tracebacks, however deep a recursion went."""
    title: str
    trace: str
    data: bytes

    def save(self, folder: Path) -> Path:
        """Write the input to a file of `folder` named by its digest."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{hashlib.sha256(self.data).hexdigest()[:12]}.bin"
        path.write_bytes(self.data)
        return path


def by_exception(kind: Kind, error: BaseException, data: bytes) -> Finding:
    """Describe what escaped from a target, or was raised in one that took too long."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if _relevant(frame)]
    places = [f"{frame.filename}:{frame.lineno}" for frame in frames]
    if isinstance(error, RecursionError):
        often = sorted(place for place, times in Counter(places).items() if times > _REPEATED)
        places = often or places  # a recursion of native code shows one line only
    elif kind == "hang":
        # The alarm strikes anywhere in the loop; the function of the target that is in it is one.
        places = [f"{frame.filename}:{frame.name}" for frame in frames[:2]]
    trace = "".join(traceback.format_exception(type(error), error, error.__traceback__))
    title = f"{type(error).__name__}: {error}"[:300]
    signature = "|".join([kind, type(error).__name__, *dict.fromkeys(places)])
    return Finding(kind, signature, title, trace, data)


def by_fault(kind: Kind, title: str, log: str, data: bytes) -> Finding:
    """Describe the end of a process, from what it wrote to its log last."""
    current = log.partition("Current thread")[2].partition("\n\n")[0]
    places = [f"{found[1]}:{found[2]}" for found in _FRAME.finditer(current)]
    return Finding(kind, "|".join([kind, title, *dict.fromkeys(places)]), title, log, data)


def _relevant(frame: traceback.FrameSummary) -> bool:
    return frame.filename not in _HARNESS
