"""A mission's log: waypoints given up, alerts, pictures, distance flown."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import Vector, length
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import RECENT
from aerodaas.messages.payload import Photo
from aerodaas.messages.readings import Alert

__all__ = ["MissionLog", "subject", "words"]

_STRIDE = 0.5
"""Metres from the last counted position before a stride counts; far above the odometry's noise,
which would add up to metres in a minute's hover."""


_AGAIN = 10 * NANOSECONDS
"""Nanoseconds after which the same alert is raised again."""


@dataclass
class MissionLog:
    """Alerts, pictures, abandoned waypoints and distance of one mission."""

    source: str
    """Source of the alerts' headers."""
    visited: deque[str] = field(default_factory=lambda: deque(maxlen=RECENT))
    """Waypoints reached last, in order."""
    visits: int = 0
    """How often a waypoint was reached."""
    _reached: set[str] = field(default_factory=set)
    given_up: dict[str, str] = field(default_factory=dict)
    """Reason by waypoint id."""
    distance: float = 0.0
    """Metres flown, counted in strides of half a metre."""
    _counted_at: Vector | None = None
    photos: list[Photo] = field(default_factory=list)
    """Every picture that was taken, oldest first."""
    photos_lost: int = 0
    """How many pictures were asked for and not taken."""
    alerts: list[Alert] = field(default_factory=list)
    """Every alert of the mission, oldest first."""
    _told: dict[tuple[str, str], int] = field(default_factory=dict)
    """Mission clock at which each kind and subject was last raised, nanoseconds."""

    def visit(self, waypoint_id: str) -> None:
        """Record that a waypoint was reached."""
        self.visited.append(waypoint_id)
        self.visits += 1
        self._reached.add(waypoint_id)

    def reached(self, waypoint_id: str) -> bool:
        """Whether a waypoint of this id was reached."""
        return waypoint_id in self._reached

    def waypoint_counts(self, ahead: Iterable[str]) -> tuple[int, int]:
        """How many waypoints were reached, and how many are known with those `ahead`."""
        return len(self._reached), len(self._reached) + len(set(ahead) - self._reached)

    def completion(self) -> str:
        """Summary of all waypoints, once none is left to fly to."""
        if not self.given_up:
            return "all waypoints are visited" if self.visits else "no waypoint is left to fly to"
        count = len(self._reached)
        visited = (
            f"{count} waypoint{'' if count == 1 else 's'} visited" if count else "none visited"
        )
        return f"no waypoint is left to fly to: {visited}, {len(self.given_up)} given up"

    def fly(self, position: Vector) -> None:
        """Add the distance to `position`, ENU metres."""
        if self._counted_at is None:
            self._counted_at = position
            return
        way = length(position - self._counted_at)
        if way >= _STRIDE:
            self.distance += way
            self._counted_at = position

    def alert(self, now: int, kind: str, text: str, about: str = "") -> None:
        """Raise an alert; a repetition that differs only in its figures waits for `_AGAIN`.

        Args:
            now: Mission clock, nanoseconds.
            kind: Kind of the alert.
            text: What the alert says.
            about: Alerts of one kind about the same are repetitions, whatever they say; by default
                the words of `text`.
        """
        subject = kind, about or words(text)
        told_at = self._told.get(subject)
        if told_at is not None and now - told_at < _AGAIN:
            return
        self._told[subject] = now
        header = Header(len(self.alerts), now, self.source)
        self.alerts.append(Alert(header, kind, text))

    def give_up(self, now: int, waypoint_id: str, reason: str) -> None:
        """Record that a waypoint will not be visited, and raise an alert.

        Args:
            now: Mission clock, nanoseconds.
            waypoint_id: Id of the waypoint.
            reason: Why, as the alert says it.
        """
        self.given_up[waypoint_id] = reason
        self.alert(now, "given_up", reason)


def words(text: str) -> str:
    """The text with its numbers masked: alerts with equal results have the same subject."""
    return re.sub(r"\d+(\.\d+)?", "#", text)


def subject(kind: str, text: str, about: str = "") -> tuple[str, str]:
    """Key by which faults are the same: several of the vehicle share one kind.

    Args:
        kind: Kind of the fault.
        text: What the fault says; its words are the key for a fault of the vehicle.
        about: What any other fault is about.
    """
    return kind, words(text) if kind == "vehicle" else about
