"""How a track has looked: appearances of a person, taken while no other box touched theirs."""

from __future__ import annotations

from collections import deque

from aerodaas.geometry.frames import Box
from aerodaas.messages.appearance import unlikeness

__all__ = ["Looks", "touches"]

_REMEMBERED = 12
"""Appearances that are kept."""
_BESIDE = 0.25
"""Part of a box's width on each side that counts as touched: an arm reaches that far."""
_ABOVE = 0.5
"""The same of its height, as the picture tilts with the drone."""


def touches(one: Box, other: Box) -> bool:
    """Whether two boxes overlap, or nearly do."""
    beside = _BESIDE * min(one[2] - one[0], other[2] - other[0])
    above = _ABOVE * min(one[3] - one[1], other[3] - other[1])
    across = min(one[2], other[2]) - max(one[0], other[0])
    down = min(one[3], other[3]) - max(one[1], other[1])
    return across > -beside and down > -above


class Looks:
    """The newest appearances, oldest first."""

    def __init__(self) -> None:
        """Start without any."""
        self._seen: deque[tuple[int, bytes]] = deque(maxlen=_REMEMBERED)

    def __len__(self) -> int:
        """Count the appearances."""
        return len(self._seen)

    def add(self, stamp: int, appearance: bytes) -> None:
        """Remember an appearance at mission time `stamp`, nanoseconds."""
        self._seen.append((stamp, appearance))

    def since(self, stamp: int = 0) -> tuple[bytes, ...]:
        """Appearances later than `stamp`."""
        return tuple(appearance for when, appearance in self._seen if when > stamp)

    def unlike(self, appearance: bytes | None) -> float | None:
        """Difference of an appearance from these, as `unlikeness`; None if not comparable."""
        return None if appearance is None else unlikeness(self.since(), (appearance,))
