"""What a lease of any drone that fits looks at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

__all__ = ["Candidate", "Fleet"]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One drone of the fleet, as it is now."""

    id: str
    camera: bool = False
    position: tuple[float, float] | None = None
    """Metres east and north; None if unknown, which is within no distance."""
    battery_minutes: float | None = None
    """Minutes of flight that its charge lasts; None if unknown, which is enough for none."""
    enabled: bool = True


Fleet: TypeAlias = Mapping[str, Candidate]
"""The whole fleet, by id."""
