"""The walk that a follower is measured by: a person in a vest, on a path with turns."""

from __future__ import annotations

import math

from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World

__all__ = ["PERSON", "walk"]

PERSON = "vip"
"""Name of the person in the world."""

_TURNS = (0, 40, -50, 90, -30, 60, -90, 0, -60)
"""Degrees by which the path turns after each leg."""
_START = (3.0, 0.0)
_WAIT = 6.0
"""Seconds until the person sets out, in which the drone takes off and finds its place."""


def walk(speed: float, duration: float, seed: int, *, legs: float = 8.0) -> World:
    """A meadow where a person walks at `speed` m/s for `duration` seconds.

    A leg of the path takes `legs` seconds, and no less than a metre; the corners are rounded.
    """
    length = max(1.0, legs * speed)
    x, y, heading = *_START, 0.0
    points = [(x, y)]
    while (len(points) - 1) * length < speed * 1.2 * duration + length:
        heading += math.radians(_TURNS[(len(points) - 1) % len(_TURNS)])
        x, y = x + length * math.cos(heading), y + length * math.sin(heading)
        points.append((round(x, 3), round(y, 3)))
    walker = {
        "kind": "person",
        "id": PERSON,
        "vest": "any",
        "at": _START,
        "motion": {
            "points": points,
            "speed": speed,
            "start": _WAIT,
            "corner": min(1.0, length / 3),
        },
    }
    east, north = max(p[0] for p in points) + 40, max(p[1] for p in points) + 40
    west, south = min(p[0] for p in points) - 40, min(p[1] for p in points) - 40
    trees = {
        "kind": "trees",
        "id": "wood",
        "count": 30,
        "area": (west, south, east, north),
        "clear": (west + 32, south + 32, east - 32, north - 32),
    }
    houses = [
        {"kind": "building", "id": "hall", "at": (east - 15, (south + north) / 2), "yaw": 80},
        {"kind": "building", "id": "barn", "at": ((west + east) / 2, north - 12), "yaw": 10},
    ]
    content = {"name": "walk", "entities": [walker, trees, *houses]}
    return World(Scenario.model_validate(content), seed)
