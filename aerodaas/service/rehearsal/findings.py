"""Findings about a rehearsed flight: each a reason to refuse it, with its figures and place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from aerodaas.service.limits import Outline

__all__ = ["Finding", "OtherArea"]


class OtherArea(Protocol):
    """Area of another granted lease."""

    @property
    def id(self) -> str:
        """Id of the lease."""
        ...

    @property
    def area(self) -> Outline:
        """Corners of the area."""
        ...


@dataclass(frozen=True)
class Finding:
    """A reason to refuse a flight."""

    robot: str
    text: str
    place: tuple[float, float] | None = None
    """Where it happened, metres east and north."""
