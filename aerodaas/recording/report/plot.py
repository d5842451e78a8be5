"""Rendered plot of a flight."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Plot"]


class Plot(NamedTuple):
    """A rendered plot with its texts."""

    name: str
    """Name of its file, without suffix."""
    title: str
    description: str
    """Alternative text of the image."""
    png: bytes
