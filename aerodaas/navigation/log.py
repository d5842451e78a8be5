"""What a mission has done and has to say: visits, refusals, alerts, distance."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from aerodaas.clock import NANOSECONDS
from aerodaas.data import Alert, Header
from aerodaas.geometry import Vector

__all__ = ["MissionLog", "words"]

_STRIDE = 0.5
"""Metres that the drone must be away from where it was last counted; far above the noise of
odometry, which would add up to metres in a minute's hover."""


_AGAIN = 10 * NANOSECONDS
"""Nanoseconds after which people are told the same once more."""


@dataclass
class MissionLog:
    """The memory of one mission."""

    source: str
    """Source of the alerts' headers."""
    visited: list[str] = field(default_factory=list)
    given_up: dict[str, str] = field(default_factory=dict)
    """Reason by waypoint id."""
    distance: float = 0.0
    """Metres flown, counted in strides of half a metre."""
    _counted_at: Vector | None = None
    alerts: list[Alert] = field(default_factory=list)
    """Every alert of the mission, oldest first."""
    _told: dict[tuple[str, str], int] = field(default_factory=dict)
    """When each thing was told last."""

    def fly(self, position: Vector) -> None:
        """Count the way to `position`, ENU metres."""
        if self._counted_at is None:
            self._counted_at = position
            return
        way = float(np.linalg.norm(position - self._counted_at))
        if way >= _STRIDE:
            self.distance += way
            self._counted_at = position

    def alert(self, now: int, kind: str, text: str) -> None:
        """Tell people something; the same again, whatever its figures, only after a while."""
        subject = kind, words(text)
        told_at = self._told.get(subject)
        if told_at is not None and now - told_at < _AGAIN:
            return
        self._told[subject] = now
        header = Header(len(self.alerts), now, self.source)
        self.alerts.append(Alert(header, kind, text))

    def give_up(self, now: int, waypoint_id: str, reason: str) -> None:
        """Note that a waypoint will not be visited, and tell people."""
        self.given_up[waypoint_id] = reason
        self.alert(now, "given_up", reason)


def words(text: str) -> str:
    """A text without its figures, by which two alerts about one thing are known."""
    return re.sub(r"\d+(\.\d+)?", "#", text)
