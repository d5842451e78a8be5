"""A finding of an examination of a machine or a cluster."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Finding"]


@dataclass(frozen=True)
class Finding:
    """One thing looked at."""

    subject: str
    text: str
    ok: bool = True
    remedy: str = ""
    """The remedy; empty for a good finding."""
