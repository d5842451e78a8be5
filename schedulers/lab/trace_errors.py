"""Errors of a trace's lines."""

from __future__ import annotations

from pathlib import Path

from aerodaas.errors import SchedulerError

__all__ = ["bad_line"]


def bad_line(path: Path, number: int, what: str) -> SchedulerError:
    """The error that says `what` is wrong in a line of the file.

    Args:
        path: The file.
        number: Number of the line, from 1.
        what: What is wrong.
    """
    return SchedulerError(f"{path}, line {number}: {what}")
