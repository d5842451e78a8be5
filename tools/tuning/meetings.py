"""People who meet a follower: a walker who turns round, by seed."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import Thing, World
from aerodaas.types.data import Odometry
from tools.tuning.walk import PERSON

__all__ = ["CONTACT", "Nearest", "returning"]

CONTACT = 0.35
"""Distance in metres of the drone's centre from a person's axis below which they touch: half a
pair of shoulders, and half a small drone."""
_BEYOND = 12.0
"""Metres that a walker goes on, towards the drone and past where it took off."""
_STANDS = 8.0
"""Metres from the drone's take-off at which the walker of `returning(…, close=False)` stands."""


@dataclass
class Nearest:
    """How near the drone came to each of some people, in space."""

    people: Sequence[Thing]
    least: float = math.inf
    """Metres from the drone's centre to the nearest point of a person's axis, feet to head."""
    before: dict[float, float] = field(default_factory=dict)
    """Distance along the ground to the first of them, metres, by time in seconds."""

    def __call__(self, time: float, pose: Odometry) -> None:
        """Note the distances at `time`."""
        east, north, up = pose.position.tolist()
        for number, person in enumerate(self.people):
            state = person.state(time)
            ground = math.hypot(state.x - east, state.y - north)
            self.least = min(self.least, math.hypot(ground, max(0.0, up - person.height)))
            if number == 0:
                self.before[time] = ground


def returning(speed: float, seed: int, *, close: bool) -> tuple[World, float]:
    """Somebody in a vest comes back at the drone at `speed` m/s; the world, and when they turn.

    With `close` they are followed first, and turn round within a step. Otherwise they stand some
    8 m off, and set out while the drone comes up to them, fast, at some 6 m.
    """
    draw = random.Random(f"{seed}/returning")
    aside = draw.uniform(-0.3, 0.3)
    if close:
        away, start = draw.uniform(5.0, 10.0) * speed, 6.0
        points = [(3.0, 0.0), (3.0 + away, 0.0), (3.0 - _BEYOND, aside)]
        turn = start + away / speed
    else:
        start = turn = draw.uniform(5.0, 7.0)
        stands = _STANDS + draw.uniform(0.0, 1.0)
        points = [(stands, 0.0), (stands - 1.5 * _BEYOND, aside)]
    motion = {"points": points, "speed": speed, "start": start, "variation": 0.0, "corner": 0.0}
    person = {"kind": "person", "id": PERSON, "vest": "any", "at": points[0], "motion": motion}
    return World(_scenario([person]), seed), turn


def _scenario(people: Sequence[Mapping[str, object]]) -> Scenario:
    """Build a meadow with trees and a house far away, for the picture."""
    trees = {
        "kind": "trees",
        "id": "wood",
        "count": 20,
        "area": (-45, -45, 45, 45),
        "clear": (-30, -30, 30, 30),
    }
    house = {"kind": "building", "id": "hall", "at": (38.0, 6.0), "yaw": 80}
    return Scenario.model_validate({"name": "meeting", "entities": [*people, trees, house]})
