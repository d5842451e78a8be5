"""Leases of drones."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import BaseModel, ConfigDict, Field

from aerodaas.service.access import Audit, Principal
from aerodaas.service.bookings import Bookings
from aerodaas.service.leases import lease_out
from aerodaas.service.routes.admission import Admission
from aerodaas.service.schemas import LeaseIn, LeaseOut, Role, Scope

__all__ = ["leases_router"]

_MOST_MINUTES = 24 * 60


class ExtensionIn(BaseModel):
    """By how much a lease is to end later."""

    model_config = ConfigDict(extra="forbid")

    minutes: Annotated[float, Field(gt=0, le=_MOST_MINUTES)]


def leases_router(bookings: Bookings, admission: Admission, audit: Audit) -> APIRouter:
    """Routes below `/v1/leases`."""
    router = APIRouter(prefix="/v1/leases", tags=["leases"])
    viewer = Depends(admission.needs(Role.VIEWER))
    pilot = Depends(admission.needs(Role.PILOT, Scope.FLY))

    @router.post("", status_code=201)
    def request(wish: LeaseIn, principal: Annotated[Principal, pilot]) -> LeaseOut:
        """Ask for drones: granted at once, or queued."""
        lease = bookings.request(principal, wish)
        audit.write(principal, "lease.request", lease.id, lease.state.value, accepted=True)
        return lease_out(lease)

    @router.get("")
    def leases(principal: Annotated[Principal, viewer]) -> list[LeaseOut]:
        """Leases that go on, in the queue's order."""
        return [lease_out(one) for one in bookings.all_seen(principal)]

    @router.get("/{lease}")
    def one(lease: str, principal: Annotated[Principal, viewer]) -> LeaseOut:
        """One lease."""
        return lease_out(bookings.seen(principal, lease))

    @router.post("/{lease}/extend")
    def extend(
        lease: str, body: ExtensionIn, principal: Annotated[Principal, pilot]
    ) -> LeaseOut:
        """Let a granted lease end later, if nobody waits for its drones."""
        found = bookings.extend(principal, lease, body.minutes)
        audit.write(principal, "lease.extend", lease, f"{body.minutes:g} min", accepted=True)
        return lease_out(found)

    @router.delete("/{lease}")
    def end(lease: str, principal: Annotated[Principal, pilot]) -> LeaseOut:
        """Give a lease back; an operator revokes anybody's. Its drones come home."""
        found = bookings.end(principal, lease)
        audit.write(
            principal, "lease.end", lease, found.reason, accepted=True, required=False
        )
        return lease_out(found)

    return router
