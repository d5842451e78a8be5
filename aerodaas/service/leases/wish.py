"""Leases as the HTTP interface asks for them and shows them."""

from __future__ import annotations

from aerodaas.protocol.schemas import LeaseIn, LeaseOut
from aerodaas.service.errors import RefusedError
from aerodaas.service.leases.candidates import Fleet
from aerodaas.service.store import Lease

__all__ = ["check_wish", "lease_of", "lease_out"]


def check_wish(wish: LeaseIn, fleet: Fleet) -> None:
    """Refuse what this fleet cannot fulfil however long one waits.

    Raises:
        RefusedError: With status 404, 409 or 422; see `LeaseBook.request`.
    """
    names = wish.robots or []
    if len(set(names)) < len(names):
        raise RefusedError(422, "a lease names each robot once")
    unknown = [name for name in names if name not in fleet]
    if unknown:
        known = ", ".join(sorted(fleet)) or "none"
        raise RefusedError(404, f"the fleet has no robot {', '.join(unknown)}; it has: {known}")
    for name in names:
        if fleet[name].objection:
            raise RefusedError(409, f"{name}: {fleet[name].objection}; ask for another")
    if not names and not any(robot.camera or not wish.camera for robot in fleet.values()):
        raise RefusedError(409, "no drone of the fleet could ever fit")


def lease_of(
    wish: LeaseIn, *, id_: str, number: int, tenant: str, account: str, now: float
) -> Lease:
    """A wish as a queued lease."""
    return Lease(
        id=id_,
        number=number,
        tenant=tenant,
        account=account,
        minutes=wish.minutes,
        asked=now,
        wanted=tuple(wish.robots or ()),
        camera=wish.camera,
        within=wish.within,
        near=wish.near,
        battery_minutes=wish.battery_minutes,
        area=None if wish.area is None else tuple(wish.area),
    )


def lease_out(lease: Lease) -> LeaseOut:
    """A lease as the HTTP interface shows it."""
    return LeaseOut(
        id=lease.id,
        tenant=lease.tenant,
        account=lease.account,
        robots=list(lease.robots or lease.wanted),
        state=lease.state,
        reason=lease.reason,
        minutes=lease.minutes,
        asked=lease.asked,
        granted=lease.granted,
        ends=lease.ends,
        area=None if lease.area is None else list(lease.area),
    )
