"""People who meet a follower: a walker who turns round, a stranger who comes, by seed."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from aerodaas.following.contact_guard import ContactGuard
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import Thing, World
from tools.tuning.walk import PERSON

__all__ = ["CONTACT", "STRANGER", "Nearest", "NoGuard", "crossing", "returning", "stranger"]

CONTACT = 0.35
"""Distance in metres of the drone's centre from a person's axis below which they touch: half a
pair of shoulders, and half a small drone."""
STRANGER = "stranger"
"""Name of the person who is not followed."""
_BEYOND = 12.0
"""Metres that a walker goes on, towards the drone and past where it took off."""
_PACE = 0.7
"""Speed of the person who is followed while a stranger comes, m/s."""


class NoGuard(ContactGuard):
    """A guard that does nothing, to compare with."""

    def evade(self, now: Odometry | None, stamp: int) -> None:
        """Give way to nobody."""
        del now, stamp

    def away(self, now: Odometry | None, stamp: int) -> float:
        """Know of nobody who turns round."""
        del now, stamp
        return math.inf

    def headway(self, pace: float, delay: float) -> float:
        """Keep no more distance from fast walkers."""
        del pace, delay
        return 0.0


@dataclass
class Nearest:
    """How near the drone came to each of some people, in space."""

    people: Sequence[Thing]
    least: float = math.inf
    """Metres from the drone's centre to the nearest point of a person's axis, feet to head."""
    path: list[tuple[float, ...]] = field(default_factory=list)
    """Seconds, the drone's place and that of the first person (metres east, north), and the
    distance to them along the ground, metres."""

    def __call__(self, time: float, pose: Odometry) -> None:
        """Note the distances at `time`."""
        east, north, up = pose.position.tolist()
        for number, person in enumerate(self.people):
            state = person.state(time)
            ground = math.hypot(state.x - east, state.y - north)
            self.least = min(self.least, math.hypot(ground, max(0.0, up - person.height)))
            if number == 0:
                self.path.append((time, east, north, state.x, state.y, ground))


def returning(speed: float, seed: int) -> tuple[World, float]:
    """Somebody in a vest turns round within a step and comes back at `speed` m/s.

    Returns the world, and the second at which they turn.
    """
    draw = random.Random(f"{seed}/returning")
    away, aside = draw.uniform(5.0, 10.0) * speed, draw.uniform(-0.3, 0.3)
    start = 6.0
    points = [(3.0, 0.0), (3.0 + away, 0.0), (3.0 - _BEYOND, aside)]
    return World(_scenario([_walker(PERSON, points, speed, start, vest="any")]), seed), (
        start + away / speed
    )


def stranger(speed: float, seed: int) -> tuple[World, float]:
    """Somebody without a vest comes at `speed` m/s at a drone that follows another at 0.7 m/s.

    They aim at where the drone will be, from ahead and to one side. Returns the world, and the
    second at which they set out.
    """
    draw = random.Random(f"{seed}/stranger")
    aside = draw.choice((-1.0, 1.0)) * math.radians(draw.uniform(15.0, 35.0))
    length, start = max(4.0, 6.0 * speed), 6.0
    setting_out = start + draw.uniform(4.0, 6.0)
    drone = 1.0 + _PACE * (setting_out + length / speed - start)
    towards = np.array([math.cos(aside), math.sin(aside)])
    points = [tuple(np.array([drone, 0.0]) + far * towards) for far in (length, -_BEYOND)]
    followed = [(3.0, 0.0), (200.0, 0.0)]
    people = [
        _walker(PERSON, followed, _PACE, start, vest="any"),
        _walker(STRANGER, points, speed, setting_out),
    ]
    return World(_scenario(people), seed), setting_out


def crossing(speed: float, seed: int, *, alike: bool) -> tuple[World, float]:
    """Somebody in a vest of the same colour crosses closely behind the one who is followed.

    They come from one side at `speed` m/s, pass half a metre to a metre and a half behind the
    followed person, who walks at 0.4 to 1 m/s, and so before the drone, and go on straight. With
    `alike` they wear the same clothes. Returns the world, and the second of the crossing.
    """
    draw = random.Random(f"{seed}/crossing")
    pace, start = draw.uniform(0.4, 1.0), 6.0
    crossed = start + draw.uniform(5.0, 7.0)
    behind, side = draw.uniform(0.5, 1.5), draw.choice((-1.0, 1.0))
    heading = side * math.radians(draw.uniform(50.0, 130.0))
    towards = np.array([math.cos(heading), math.sin(heading)])
    place = np.array([3.0 + pace * (crossed - start) - behind, 0.0])
    before = speed * (crossed - start)
    points = [tuple(place - before * towards), tuple(place + _BEYOND * towards)]
    vest = draw.choice(("yellow", "lime", "orange"))
    followed = [(3.0, 0.0), (200.0, 0.0)]
    clothes = (seed, seed if alike else seed + 1)
    people = [
        _walker(PERSON, followed, pace, start, vest=vest, clothes=clothes[0]),
        _walker(STRANGER, points, speed, start, vest=vest, clothes=clothes[1]),
    ]
    return World(_scenario(people), seed), crossed


def _walker(
    name: str,
    points: Sequence[tuple[float, ...]],
    speed: float,
    start: float,
    *,
    vest: str = "none",
    clothes: int | None = None,
) -> dict[str, object]:
    motion = {"points": points, "speed": speed, "start": start, "variation": 0.0, "corner": 0.0}
    worn = {"vest": vest, "clothes": clothes}
    return {"kind": "person", "id": name, "at": points[0], "motion": motion, **worn}


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
