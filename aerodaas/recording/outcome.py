"""Summary of a closed recording: messages, drops, duration and size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

__all__ = ["RecordingSummary"]


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
