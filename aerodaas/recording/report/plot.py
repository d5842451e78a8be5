"""A drawn plot of a flight."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Plot"]


class Plot(NamedTuple):
    """One plot of a flight."""

    name: str
    """Of its file."""
    title: str
    description: str
    """Text for readers who cannot see it."""
    png: bytes
