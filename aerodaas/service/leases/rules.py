"""Rules of the queue, as functions of leases, fleet and now."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

from aerodaas.protocol.schemas import LeaseState
from aerodaas.service.leases.candidates import Fleet, distance, waited_for
from aerodaas.service.store import Lease, LeaseEnd

__all__ = ["MINUTE", "grants", "is_waited_for", "over"]

MINUTE = 60.0
"""Seconds."""


def over(live: Iterable[Lease], now: float) -> list[Lease]:
    """Those whose time is over, as ended."""
    return [
        replace(
            lease,
            state=LeaseState.ENDED,
            ended=lease.ends,
            end=LeaseEnd.EXPIRED,
            reason=f"its {lease.minutes:g} minutes are over",
        )
        for lease in live
        if lease.ends is not None and lease.ends <= now
    ]


def grants(live: Collection[Lease], now: float, fleet: Fleet) -> list[Lease]:
    """Those of the queue that can have their drones now, as granted.

    Each lease that must wait keeps the robots it waits for from all later ones: of several robots,
    those that are free stay so for it, or it might never find them free together.

    Args:
        live: Leases queued, or granted and not over, in the queue's order.
        now: Moment, seconds of Unix time.
        fleet: The drones as they are now.
    """
    taken = {robot for lease in live for robot in lease.robots}
    taken |= {id_ for id_, robot in fleet.items() if robot.busy}
    granted = []
    for lease in live:
        if lease.state is not LeaseState.QUEUED:
            continue
        robots = waited_for(lease, fleet)
        free = robots - taken
        if not free or (lease.wanted and free != robots):
            taken |= robots
            continue
        # The nearest of any; the order by name makes it the same one each time.
        nearest = min(sorted(free), key=lambda id_: distance(lease, fleet[id_]))
        chosen = lease.wanted or (nearest,)
        taken.update(chosen)
        granted.append(
            replace(
                lease,
                state=LeaseState.GRANTED,
                robots=chosen,
                granted=now,
                ends=now + lease.minutes * MINUTE,
            )
        )
    return granted


def is_waited_for(held: Lease, live: Iterable[Lease], fleet: Fleet) -> bool:
    """Whether a queued lease waits for a robot that `held` holds."""
    return any(
        lease.state is LeaseState.QUEUED and not waited_for(lease, fleet).isdisjoint(held.robots)
        for lease in live
    )
