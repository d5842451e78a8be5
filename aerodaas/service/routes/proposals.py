"""Proposed missions and changes: made, checked, rehearsed, and put to a person for approval."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request

from aerodaas.protocol.proposals import (
    ChangeIn,
    CheckReport,
    ProposalIn,
    RefusedCallIn,
    RehearseIn,
)
from aerodaas.protocol.schemas import MissionOut, Role, Scope
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.principal import Principal
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission
from aerodaas.service.proposals.record import plain_text
from aerodaas.service.proposals.service import ProposalService

__all__ = ["ProposalRoutes"]


class ProposalRoutes:
    """Routes below `/v1/proposals`, and `/v1/missions/{id}/changes`, for agents."""

    def __init__(self, proposals: ProposalService, admission: Admission, audit: Audit) -> None:
        """Answer from `proposals`."""
        self._proposals = proposals
        self._admission = admission
        self._audit = audit

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1", "proposals")
        posted: dict[str, Any] = {"methods": ["POST"], "status_code": 202}
        router.add_api_route("/proposals", self.propose, **posted)
        router.add_api_route("/proposals/{mission}/check", self.check)
        router.add_api_route("/proposals/{mission}/rehearse", self.rehearse, **posted)
        router.add_api_route("/proposals/{mission}/request", self.request, **posted)
        router.add_api_route("/missions/{mission}/changes", self.change, **posted)
        router.add_api_route("/refused-calls", self.refused_call, methods=["POST"], status_code=204)
        return router

    def propose(self, body: ProposalIn, request: Request) -> MissionOut:
        """Keep a mission that is proposed; nothing flies by it.

        The same document with the same minutes and parent is the same proposal until it is over.
        """
        principal = self._require(request)
        with self._admission.auditing(principal, request):
            found = self._proposals.propose(principal, body)
        return self._audited(principal, "proposal.create", found)

    def check(self, mission: str, request: Request) -> CheckReport:
        """Check a proposal without flying, from its drones' present charge."""
        principal = self._admission.require(request, Role.VIEWER, agents=True)
        return self._proposals.check(principal, mission)

    def change(self, mission: str, body: ChangeIn, request: Request) -> MissionOut:
        """Replace the waypoints of a robot in flight, by a proposal of its own.

        It is rehearsed from where the robot is. Within the envelope that was approved with the
        mission it is applied then; otherwise it waits for an approval.
        """
        principal = self._require(request)
        with self._admission.auditing(principal, request):
            found = self._proposals.change(principal, mission, body)
        return self._audited(principal, "proposal.change", found)

    def rehearse(self, mission: str, body: RehearseIn, request: Request) -> MissionOut:
        """Have a proposal flown in simulation, as often as seeds are asked for."""
        principal = self._require(request)
        with self._admission.auditing(principal, request):
            found = self._proposals.rehearse(principal, mission, body.seeds)
        return self._audited(principal, "proposal.rehearse", found)

    def request(self, mission: str, request: Request) -> MissionOut:
        """Ask for the approval of a proposal whose newest rehearsal was good."""
        principal = self._require(request)
        with self._admission.auditing(principal, request):
            found = self._proposals.request_approval(principal, mission)
        return self._audited(principal, "proposal.request", found)

    def refused_call(self, body: RefusedCallIn, request: Request) -> None:
        """Write a call into the audit log that an agent's tool has refused by its form."""
        principal = self._require(request)
        tool, text = plain_text(body.tool), plain_text(body.text)
        self._audit.write(principal, "tool.refused", tool, text, accepted=False)

    def _require(self, request: Request) -> Principal:
        return self._admission.require(request, Role.PILOT, Scope.PROPOSE, agents=True)

    def _audited(self, principal: Principal, action: str, found: MissionOut) -> MissionOut:
        told = "" if found.proposal is None else found.proposal.hash
        self._audit.write(principal, action, found.id, told, accepted=True)
        return found
