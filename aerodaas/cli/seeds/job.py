"""One run of many, as its process is told to fly it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from aerodaas.config.options import RunOptions

__all__ = ["OUTPUT", "Job"]

OUTPUT = "output.txt"
"""Name of the file, beside the recording, with what a run has printed."""


@dataclass(frozen=True)
class Job:
    """An application and the options of one of its runs."""

    application: Path
    words: list[str]
    """Arguments of the application."""
    options: RunOptions

    def with_seed(self, seed: int) -> Job:
        """The same with `seed`, recorded in a folder of its own below that of `options.record`."""
        assert self.options.record is not None  # noqa: S101 - `fly_seeds` sets it
        folder = self.options.record / f"seed-{seed}"
        return replace(self, options=replace(self.options, seed=seed, record=folder))
