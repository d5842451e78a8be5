"""Which robots share a drone's actor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from aerodaas.actors.cluster.ray_cluster import Placement
from aerodaas.actors.drone.vehicle_controller import RobotSpec
from aerodaas.actors.session import Session

__all__ = ["MOST_ALONE", "MOST_TOGETHER", "by_actor"]

MOST_ALONE = 8
"""Simulated robots of a flight up to which each has an actor of its own."""
MOST_TOGETHER = 10
"""Simulated robots that share an actor at most, at real time's pace: with a millisecond for each,
a fifth of their loop's period."""


def by_actor(
    specs: Sequence[RobotSpec], edges: Sequence[Placement], session: Session
) -> tuple[tuple[RobotSpec, ...], ...]:
    """Distribute robots, each with its place in `edges`, over drone actors.

    In lockstep one actor flies all of them. In real time each robot has an actor, and thus a
    process, of its own; only the simulated ones of a large flight share actors, for the processes
    of fifty of them, and what these tell each other, would keep a machine busy by themselves.
    """
    if session.speed is None:
        return (tuple(specs),)
    real: list[RobotSpec] = []
    simulated: list[RobotSpec] = []
    for one in specs:
        (simulated if one.robot.driver == "simulated" else real).append(one)
    if len(simulated) <= MOST_ALONE:
        return tuple((one,) for one in specs)
    groups: list[tuple[RobotSpec, ...]] = [(one,) for one in real]
    most = max(1, int(MOST_TOGETHER / max(1.0, session.speed)))
    places = dict(zip((one.robot.id for one in specs), edges, strict=True))
    for place in dict.fromkeys(places[one.robot.id] for one in simulated):
        here = [one for one in simulated if places[one.robot.id] == place]
        count = math.ceil(len(here) / most)
        ends = [len(here) * number // count for number in range(count + 1)]
        groups += [tuple(here[start:end]) for start, end in pairwise(ends)]
    return tuple(groups)
