"""Which robots share a drone's actor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from aerodaas.drivers.loading import link_of
from aerodaas.errors import ConfigError
from aerodaas.runtime.nodes.controller import RobotSpec
from aerodaas.runtime.placement import Placement
from aerodaas.runtime.session import Session

__all__ = ["MOST_ALONE", "MOST_TOGETHER", "by_actor"]

MOST_ALONE = 8
"""Simulated robots of a flight up to which each has an actor of its own."""
MOST_TOGETHER = 10
"""Simulated robots that share an actor at most, at real time's pace: with a millisecond for each,
a fifth of their loop's period."""


def by_actor(
    specs: Sequence[RobotSpec], edges: Sequence[Placement], session: Session
) -> tuple[tuple[RobotSpec, ...], ...]:
    """Distribute robots over drone actors.

    In simulated time one node flies all of them. In real time each robot has an actor, and thus a
    process, of its own, with two exceptions: robots on one link share the process that opens it,
    and the simulated ones of a large flight share actors, for the processes of fifty of them, and
    what these tell each other, would keep a machine busy by themselves.

    Args:
        specs: The robots.
        edges: Place of each robot.
        session: Its speed tells simulated from real time.

    Raises:
        ConfigError: If robots share a link from different places.
    """
    if session.speed is None:
        return (tuple(specs),)
    places = dict(zip((one.robot.id for one in specs), edges, strict=True))
    simulated = [one for one in specs if one.robot.driver == "simulated"]
    if len(simulated) <= MOST_ALONE:
        return _by_link(specs, places)
    groups = [*_by_link([one for one in specs if one.robot.driver != "simulated"], places)]
    most = max(1, int(MOST_TOGETHER / max(1.0, session.speed)))
    for place in dict.fromkeys(places[one.robot.id] for one in simulated):
        here = [one for one in simulated if places[one.robot.id] == place]
        count = math.ceil(len(here) / most)
        ends = [len(here) * number // count for number in range(count + 1)]
        groups += [tuple(here[start:end]) for start, end in pairwise(ends)]
    return tuple(groups)


def _by_link(
    specs: Sequence[RobotSpec], places: Mapping[str, Placement]
) -> tuple[tuple[RobotSpec, ...], ...]:
    groups: dict[str, list[RobotSpec]] = {}
    for one in specs:
        name = one.robot.id
        groups.setdefault(link_of(one.robot) or f"robot {name}", []).append(one)
    for group in groups.values():
        first, *others = (spec.robot.id for spec in group)
        for other in others:
            if places[other] != places[first]:
                raise ConfigError(
                    f"robots {first} and {other} share a link, which one process opens: give both "
                    'the same "edge"'
                )
    return tuple(tuple(group) for group in groups.values())
