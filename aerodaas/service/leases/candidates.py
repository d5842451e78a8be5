"""Which drones a lease asks for, as the fleet is now."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from aerodaas.service.store import Lease

__all__ = ["Candidate", "Fleet", "distance", "waited_for"]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One drone of the fleet, as it is now."""

    id: str
    camera: bool = False
    position: tuple[float, float] | None = None
    """Metres east and north; None if unknown, which is within no distance."""
    battery_minutes: float | None = None
    """Minutes of flight that its charge lasts; None if unknown, which is enough for none."""
    objection: str = ""
    """Why it cannot be flown now: out of service, out of reach, low; empty if it can."""
    busy: bool = False
    """Whether it still flies, for a lease that holds it or one that has ended: no other lease gets
    it before it has landed."""


Fleet: TypeAlias = Mapping[str, Candidate]
"""The whole fleet, by id."""


def waited_for(lease: Lease, fleet: Fleet) -> frozenset[str]:
    """Robots that a queued lease could use now, were they all free.

    All of those that it names, if each can be flown; or each one that fits.
    """
    if not lease.wanted:
        return frozenset(id_ for id_, robot in fleet.items() if _fits(lease, robot))
    ready = all(id_ in fleet and not fleet[id_].objection for id_ in lease.wanted)
    return frozenset(lease.wanted) if ready else frozenset()


def distance(lease: Lease, robot: Candidate) -> float:
    """Metres from where a lease wants any drone; infinity if it is not known where this one is."""
    return math.inf if robot.position is None else math.dist(robot.position, lease.near)


def _fits(lease: Lease, robot: Candidate) -> bool:
    return (
        not robot.objection
        and (robot.camera or not lease.camera)
        and (lease.within is None or distance(lease, robot) <= lease.within)
        and (lease.battery_minutes or 0.0) <= (robot.battery_minutes or 0.0)
    )
