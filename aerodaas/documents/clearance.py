"""Check of a way against what stands in the simulated world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from aerodaas.config.model import SimulationConfig
from aerodaas.geometry.frames import Vector, length
from aerodaas.simulation.collision import CLEARANCE, Nearest, Obstacles
from aerodaas.simulation.scenario import Person
from aerodaas.simulation.world import World

__all__ = ["StandingObstacles", "TooNear"]

_FROM_PEOPLE = 2.0
"""Metres that a drone's way keeps from people who stand."""
_SHORTEST = 0.1
"""Metres between two places of a way at which is looked, at least."""


@dataclass(frozen=True, slots=True)
class TooNear:
    """A place of a way that is too near to something."""

    place: Vector
    nearest: Nearest
    limit: float
    """Metres that are kept from it."""


class StandingObstacles:
    """Everything in a world that does not move; where moving things are, a rehearsal shows."""

    def __init__(self, config: SimulationConfig) -> None:
        """Load the world; raises ConfigError for an invalid one."""
        world = World.load(config)
        moving = {thing.id for thing in world.things if getattr(thing.spec, "motion", None)}
        people = {thing.id for thing in world.things if isinstance(thing.spec, Person)}
        self._obstacles = Obstacles(world)
        self._searches = (
            (CLEARANCE, frozenset(moving | people)),
            (_FROM_PEOPLE, frozenset({thing.id for thing in world.things} - people | moving)),
        )
        """Distances that are kept, and what each one does not concern."""

    def along(self, points: Sequence[Vector]) -> Iterator[TooNear]:
        """The place of a way that is nearest to something, where it is too near.

        Args:
            points: Corners of the way, ENU metres.
        """
        for limit, ignored in self._searches:
            worst: TooNear | None = None
            for begin, end in pairwise(points):
                for place, nearest in self._looks(begin, end, limit, ignored):
                    if nearest.distance < (limit if worst is None else worst.nearest.distance):
                        worst = TooNear(place, nearest, limit)
            if worst is not None:
                yield worst

    def _looks(
        self, begin: Vector, end: Vector, limit: float, ignored: frozenset[str]
    ) -> Iterator[tuple[Vector, Nearest]]:
        """Places of a straight way, so dense that nothing nearer than `limit` lies between two."""
        distance = length(end - begin)
        gone = 0.0
        while True:
            place = begin + (end - begin) * (gone / distance if distance else 0.0)
            east, north, up = (float(axis) for axis in place)
            nearest = self._obstacles.nearest((east, north, up), 0.0, ignored)
            if nearest is None:
                return
            yield place, nearest
            if gone >= distance:
                return
            gone = min(distance, gone + max(_SHORTEST, nearest.distance - limit))
