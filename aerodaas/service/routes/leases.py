"""Leases of drones."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from aerodaas.protocol.schemas import LeaseIn, LeaseOut, Role, Scope
from aerodaas.service.access.audit import Audit
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.leases.lease_table import lease_out

__all__ = ["LeaseRoutes"]

_MOST_MINUTES = 24 * 60


class ExtensionIn(BaseModel):
    """By how much a lease is to end later."""

    model_config = ConfigDict(extra="forbid")

    minutes: Annotated[float, Field(gt=0, le=_MOST_MINUTES)]


class LeaseRoutes:
    """Routes below `/v1/leases`."""

    def __init__(self, leases: LeaseService, admission: Admission, audit: Audit) -> None:
        """Answer from the leases."""
        self._leases = leases
        self._admission = admission
        self._audit = audit

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1/leases", "leases")
        router.add_api_route("", self.request, methods=["POST"], status_code=201)
        router.add_api_route("", self.leases)
        router.add_api_route("/{lease}", self.lease)
        router.add_api_route("/{lease}", self.end, methods=["DELETE"])
        router.add_api_route("/{lease}/extend", self.extend, methods=["POST"])
        return router

    def request(self, wish: LeaseIn, request: Request) -> LeaseOut:
        """Ask for drones: granted at once, or queued."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        with self._admission.auditing(principal, request):
            lease = self._leases.request(principal, wish)
        self._audit.write(principal, "lease.request", lease.id, lease.state.value, accepted=True)
        return lease_out(lease)

    def leases(self, request: Request) -> list[LeaseOut]:
        """Leases that go on, in the queue's order."""
        principal = self._admission.require(request, Role.VIEWER, agents=True)
        return [lease_out(one) for one in self._leases.all_seen(principal)]

    def lease(self, lease: str, request: Request) -> LeaseOut:
        """One lease."""
        principal = self._admission.require(request, Role.VIEWER, agents=True)
        return lease_out(self._leases.seen(principal, lease))

    def extend(self, lease: str, body: ExtensionIn, request: Request) -> LeaseOut:
        """Let a granted lease end later, if nobody waits for its drones."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        with self._admission.auditing(principal, request):
            found = self._leases.extend(principal, lease, body.minutes)
        self._audit.write(principal, "lease.extend", lease, f"{body.minutes:g} min", accepted=True)
        return lease_out(found)

    def end(self, lease: str, request: Request) -> LeaseOut:
        """Give a lease back; an operator revokes anybody's. Its drones come home."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        with self._admission.auditing(principal, request):
            found = self._leases.end(principal, lease)
        text = found.reason
        self._audit.write(principal, "lease.end", lease, text, accepted=True, required=False)
        return lease_out(found)
