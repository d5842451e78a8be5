"""What an examination of a machine or a cluster finds."""

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
    """What to do about it; empty where it is well."""
