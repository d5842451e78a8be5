"""What flies beside a drone, as far as it is kept away from; and who of ours has fallen silent."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from aerodaas.clock import seconds
from aerodaas.geometry.frames import Vector, is_finite
from aerodaas.messages.serialization.records import fast_pickle
from aerodaas.messages.vehicle import VehicleState

__all__ = ["SILENT", "Neighbour", "Neighbours", "Whereabouts"]

SILENT = 1.0
"""Seconds after which a drone that tells nothing of its place is no longer believed to brake: it
tells twenty times a second."""


@dataclass(frozen=True, slots=True, eq=False)
class Neighbour:
    """Something else that flies: position (ENU metres) and velocity (ENU m/s)."""

    position: Vector
    """`up` is NaN for an aircraft whose height is not known."""
    velocity: Vector
    apart: tuple[float, float] | None = None
    """Metres along the ground and in height to keep from what does not give way: one of the two is
    enough. None: another drone of ours, which brakes, too."""
    limit: str = "separation"
    """The limit that a setpoint is said to be clipped by because of it."""


@fast_pickle
@dataclass(frozen=True, slots=True, eq=False)
class Whereabouts:
    """Where one of our drones was at `stamp` (mission clock, ns), by its own state."""

    stamp: int
    position: Vector
    """Metres, ENU."""
    velocity: Vector
    """m/s, ENU."""
    flying: bool

    @classmethod
    def of(cls, state: VehicleState) -> Whereabouts | None:
        """By its newest state; None where that has a number that is not finite."""
        place, velocity = state.odometry.position, state.odometry.velocity
        known = is_finite(place) and is_finite(velocity)
        return cls(state.stamp, place, velocity, state.armed) if known else None

    def age(self, now: int) -> float:
        """Seconds since then; 0 on the ground, where a drone stays without telling so."""
        return max(0.0, seconds(now - self.stamp)) if self.flying else 0.0


class Neighbours:
    """Where our drones are, by what each has told last."""

    def __init__(self) -> None:
        """Know of none."""
        self._known: dict[str, Whereabouts] = {}
        self._silent: set[str] = set()
        self._now = 0
        self._present: dict[str, tuple[Whereabouts, float, Neighbour]] = {}
        """What is known of each at `_now`, for which distance, and what that makes of it: all
        drones of one node ask at one moment."""

    def update(self, name: str, where: Whereabouts | None) -> None:
        """Update the whereabouts of the drone `name`; None, a place unknown to it, keeps the last.

        Args:
            name: Id of the drone.
            where: What it tells; None, a place unknown to it, leaves the last.
        """
        if where is not None:
            self._known[name] = where

    def of(self, names: Collection[str]) -> dict[str, Whereabouts]:
        """Whereabouts of these drones, as far as they are known."""
        return {name: self._known[name] for name in names if name in self._known}

    def around(self, name: str, now: int, separation: float) -> list[Neighbour]:
        """All drones but `name`, where they are by now.

        Each is where its velocity has taken it since it told. After `SILENT` seconds that is a
        guess: it is kept away from like an aircraft that flies on and does not give way.

        Args:
            name: Id of the drone that keeps away.
            now: Mission clock, nanoseconds.
            separation: Distance that it keeps, metres; 0 returns none.
        """
        if separation <= 0.0:
            return []
        if now != self._now:
            self._now = now
            self._present.clear()
        return [self._by_now(other, separation) for other in self._known if other != name]

    def _by_now(self, name: str, separation: float) -> Neighbour:
        where, made = self._known[name], self._present.get(name)
        if made is not None and made[0] is where and made[1] == separation:
            return made[2]
        age = where.age(self._now)
        position = where.position + where.velocity * min(age, SILENT)
        apart = (separation, separation) if age > SILENT else None
        neighbour = Neighbour(position, where.velocity, apart)
        self._present[name] = where, separation, neighbour
        return neighbour

    def newly_silent(self, now: int, own: Collection[str]) -> list[str]:
        """Drones other than our `own` that have told nothing for `SILENT` s; each silence once.

        Args:
            now: Mission clock, nanoseconds.
            own: Ids of the drones that are not reported.
        """
        silent = {
            name
            for name, where in self._known.items()
            if name not in own and where.age(now) > SILENT
        }
        new, self._silent = silent - self._silent, silent
        return sorted(new)
