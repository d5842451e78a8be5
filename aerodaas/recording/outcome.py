"""The outcome of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

__all__ = ["RecordingSummary"]


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Figures of a recording that has been closed."""

    path: Path
    channels: Mapping[str, int]
    """Messages written, by topic."""
    drops: Mapping[str, int]
    """Messages that did not reach the recording, by stream."""
    duration: float
    """Mission seconds from the first message to the last."""
    size: int
    """Bytes of the file."""
    stopped: str = ""
    """Why recording ended early, or empty."""

    @property
    def messages(self) -> int:
        """Messages written in all."""
        return sum(self.channels.values())

    def __str__(self) -> str:
        """One line for a person."""
        text = (
            f"{self.path}: {self.size / 1e6:.1f} MB, {self.duration:.1f} s, "
            f"{self.messages} messages on {len(self.channels)} channels"
        )
        dropped = sum(self.drops.values())
        if dropped:
            text += f", {dropped} dropped"
        return f"{text}; stopped early: {self.stopped}" if self.stopped else text
