"""When pictures are due on the way to a waypoint: by distance or by time, while the drone flies on.

Distance is counted along the straight line of the leg, so that pictures of a survey lie where they
were planned, whatever the wind does. Legs that follow one another with the same distance count on
around the corner.
"""

from __future__ import annotations

import math

import numpy as np

from aerodaas.clock import NANOSECONDS
from aerodaas.extensions.payload.actions import TriggerPhotos
from aerodaas.geometry.frames import Vector, length, wrap_angle
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import Waypoint

__all__ = ["PhotoTrigger"]

_HALF_TURN = 0.025
"""Seconds: half a period of the setpoint loop, by which the nearest turn to a place is told."""
_ROUNDING = 1e-3
"""Metres by which a place may lie behind the end of its leg and still be on it."""
_THERE = 0.1
"""Metres before the last place from which a drone that has arrived takes its picture."""
_SETTLING = 2 * NANOSECONDS
"""Nanoseconds after arrival when it takes it in any case."""
_ASIDE = 0.2
"""Metres beside the line within which a drone flies on it."""
_ACROSS = 0.4
"""m/s across the line at which it would leave it."""
_ALONG = 0.1
"""Radians from the line within which its nose looks along it: a picture that is turned by as much
loses a tenth of its overlap at the edges."""
_ALIGNING = 4 * NANOSECONDS
"""Nanoseconds that a drone gets to come onto the line, and to turn, before its pictures begin."""
_AHEAD = (8.0, 3.0)
"""Metres on the line that a drone aims ahead at least, and seconds of its flight: twice the way in
which it would brake, so that the point ahead never slows it down."""
_GAP = NANOSECONDS
"""Nanoseconds between two calls after which the drone was elsewhere, and time begins anew."""


class PhotoTrigger:
    """Trigger of one leg, asked once a turn."""

    def __init__(
        self, waypoint: Waypoint, start: Vector, now: int, before: PhotoTrigger | None = None
    ) -> None:
        """Trigger on the straight way from `start` to `waypoint`, both ENU metres, from `now` (ns).

        `before` is the trigger of a leg that ended at `start`: one of the same distance or interval
        is gone on with.
        """
        action = waypoint.action(TriggerPhotos)
        self.distance = None if action is None else action.distance
        """Metres between two pictures; None by time."""
        self.interval = None if action is None else action.interval
        """Seconds between two pictures; None by distance."""
        self._start = start
        self._way = waypoint.position - start
        self._length = length(self._way)
        self._begin = now
        self._aligned = self.distance is None or self._length < _ROUNDING
        self._next = 0.0
        self._due_at = self._asked_at = now
        if before is not None and self.distance is not None and before.distance == self.distance:
            self._next = max(0.0, before.overhang)
        if before is not None and self.interval is not None and before.interval == self.interval:
            self._due_at = before.due_at

    @property
    def overhang(self) -> float:
        """Metres from the end of the leg to the next place beyond it."""
        return self._next - self._length

    @property
    def due_at(self) -> int:
        """Mission clock at which the next picture by time is due, nanoseconds."""
        return self._due_at

    @property
    def bearing(self) -> float | None:
        """Direction of the line with pictures, radians from east; None without, and upright."""
        east, north, _ = self._way
        level = self.distance is not None and math.hypot(east, north) > _ROUNDING
        return math.atan2(north, east) if level else None

    def place_ahead(self, odometry: Odometry, now: int, *, turns: bool = True) -> Vector | None:
        """Where to fly so that the drone is on the line, ENU metres; None for straight to its end.

        At first that is the line itself: a drone that comes round a corner has slid beside it, and
        its nose is not there yet.

        Args:
            odometry: Where the drone is, how it moves and where it faces.
            now: Mission clock, nanoseconds.
            turns: Whether its nose turns along the line.
        """
        if self.distance is None or self._length < _ROUNDING or not _is_finite(odometry):
            return None
        along = self._way / self._length
        offset = odometry.position - self._start
        progress = float(np.dot(offset, along))
        if not self._aligned:
            across = odometry.velocity - along * float(np.dot(odometry.velocity, along))
            slid = length(offset - along * max(progress, 0.0))
            on_line = slid <= _ASIDE and length(across) <= _ACROSS
            ready = on_line and not (turns and self._looks_aside(odometry))
            self._aligned = ready or now - self._begin > _ALIGNING
        least, moment = _AHEAD
        lead = max(least, moment * length(odometry.velocity)) if self._aligned else 0.0
        ahead = min(max(progress, 0.0) + lead, self._length)
        return self._start + along * ahead

    def _looks_aside(self, odometry: Odometry) -> bool:
        """Whether the nose is known to look elsewhere than along the line."""
        bearing, yaw = self.bearing, odometry.yaw
        if bearing is None or not math.isfinite(yaw):
            return False
        return abs(wrap_angle(yaw - bearing)) > _ALONG

    @property
    def aligned(self) -> bool:
        """Whether the drone flies along the line by now, with a place ahead as its target."""
        return self.distance is not None and self._aligned

    @property
    def awaits(self) -> bool:
        """Whether a place on this leg has not been passed yet."""
        return self.distance is not None and self._next <= self._length + _ROUNDING

    def ends_with_place(self, radius: float) -> bool:
        """Whether the last place left on this leg lies within `radius` metres of its end."""
        if self.distance is None or not self.awaits:
            return False
        return (self._length + _ROUNDING - self._next) % self.distance <= radius + _ROUNDING

    def pass_all(self) -> list[Vector]:
        """Places by distance that are not passed yet, ENU metres in order; they are from now on."""
        places: list[Vector] = []
        while self.distance is not None and self.awaits:
            share = self._next / self._length if self._length > _ROUNDING else 0.0
            places.append(self._start + self._way * share)
            self._next += self.distance
        return places

    def passed(self, odometry: Odometry, now: int, arrived_at: int | None) -> int:
        """How many pictures have become due since the last call; more than one is too late.

        Args:
            odometry: Where the drone is.
            now: Mission clock, nanoseconds.
            arrived_at: Mission clock at arrival at the leg's end, nanoseconds; None before.
        """
        if self.interval is not None:
            return self._by_time(now)
        if self.distance is None:
            return 0
        if not self._aligned and arrived_at is None:
            return 0
        if arrived_at is not None and now - arrived_at >= _SETTLING:
            progress = self._length
        elif _is_finite(odometry):
            progress = self._progress(odometry) + (0.0 if arrived_at is None else _THERE)
        else:
            return 0
        reached = min(progress, self._length) + _ROUNDING
        if reached < self._next:
            return 0
        count = math.floor((reached - self._next) / self.distance) + 1
        self._next += count * self.distance
        return count

    def _progress(self, odometry: Odometry) -> float:
        if self._length < _ROUNDING:
            return 0.0
        ahead = odometry.position + odometry.velocity * _HALF_TURN - self._start
        return float(np.dot(ahead, self._way)) / self._length

    def _by_time(self, now: int) -> int:
        assert self.interval is not None  # noqa: S101 - asked only then
        period = round(self.interval * NANOSECONDS)
        if now - self._asked_at > _GAP:
            self._due_at = max(self._due_at, now)
        self._asked_at = now
        count = max(0, (now - self._due_at) // period + 1)
        self._due_at += count * period
        return count


def _is_finite(odometry: Odometry) -> bool:
    return bool(np.isfinite(odometry.position).all() and np.isfinite(odometry.velocity).all())
