"""Output file of a recording: never overwrites a file, always ends at a whole record."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aerodaas.errors import RecordingError

__all__ = ["Output", "RecordingSummary"]


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Figures of a closed recording."""

    path: Path
    channels: Mapping[str, int]
    """Messages written, by topic."""
    drops: Mapping[str, int]
    """Messages that did not reach the recording, by stream."""
    duration: float
    """Mission seconds from the first message to the last."""
    size: int
    """File size in bytes."""
    stopped: str = ""
    """Reason why recording ended early, or empty."""

    @property
    def messages(self) -> int:
        """Total number of messages written."""
        return sum(self.channels.values())

    def __str__(self) -> str:
        """One readable line."""
        text = (
            f"{self.path}: {self.size / 1e6:.1f} MB, {self.duration:.1f} s, "
            f"{self.messages} messages on {len(self.channels)} channels"
        )
        dropped = sum(self.drops.values())
        if dropped:
            text += f", {dropped} dropped"
        return f"{text}; stopped early: {self.stopped}" if self.stopped else text


class Output:
    """A new file for MCAP's writer, which passes whole records to each `write`.

    Unbuffered, so that completed writes survive the death of this process. A write that fails
    half-way (disk full) is rolled back, and the file stays readable.
    """

    def __init__(self, path: Path) -> None:
        """Create `path` and its folders; raises RecordingError if it exists or cannot be made."""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("xb", buffering=0)
        except FileExistsError as error:
            if path.exists():
                raise RecordingError(
                    f"{path} already exists and is not overwritten; "
                    "give --record another path or move the file away"
                ) from None
            raise RecordingError(
                f"cannot create {path}: {error.filename} is not a folder; choose another path"
            ) from None
        except OSError as error:
            raise RecordingError(
                f"cannot create {path}: {error.strerror}; "
                "choose a folder that you may write to with --record"
            ) from None
        self._size = 0

    def write(self, data: bytes) -> int:
        """Append all of `data`; raises OSError, with nothing appended, if that fails."""
        remaining = memoryview(data)
        try:
            while remaining:
                remaining = remaining[self._file.write(remaining) or 0 :]
        except OSError:
            self._file.seek(self._size)
            self._file.truncate()
            raise
        self._size += len(data)
        return len(data)

    def tell(self) -> int:
        """Number of bytes written so far."""
        return self._size

    def flush(self) -> None:
        """Do nothing: every write has reached the operating system when it returns."""

    def sync(self) -> None:
        """Wait until the operating system has written everything to disk; raises OSError."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()
