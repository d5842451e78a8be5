"""A provider's missions on their way: submission, approval, grants, recordings."""

from __future__ import annotations

import re
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request
from fastapi.responses import FileResponse

from aerodaas.protocol.proposals import ApprovalIn
from aerodaas.protocol.schemas import GrantIn, MissionIn, MissionOut, Role, Scope, Word
from aerodaas.service.access.audit import Audit
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission
from aerodaas.service.mission_service import MissionService

__all__ = ["SubmissionRoutes"]

_STRING = re.compile(r'"((?:[\x20-\x21\x23-\x5b\x5d-\x7e]|\\["\\]){1,255})"')
"""A string of HTTP's structured fields (RFC 8941), neither empty nor long: an idempotency key, as
in the IETF's draft of that header field (draft-ietf-httpapi-idempotency-key-header)."""


class SubmissionRoutes:
    """Routes below `/v1/missions` for what a provider alone does with missions."""

    def __init__(self, missions: MissionService, admission: Admission, audit: Audit) -> None:
        """Answer from `missions`."""
        self._missions = missions
        self._admission = admission
        self._audit = audit

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1/missions", "missions")
        router.add_api_route("", self.submit, methods=["POST"], status_code=202)
        router.add_api_route("/{mission}", self.cancel, methods=["DELETE"])
        router.add_api_route("/{mission}/approve", self.approve, methods=["POST"])
        grants = "/{mission}/grants/{tenant}"
        router.add_api_route(grants, self.grant, methods=["PUT"])
        router.add_api_route(grants, self.withdraw, methods=["DELETE"])
        files: dict[str, Any] = {"response_class": FileResponse}
        router.add_api_route("/{mission}/recording", self.recording, **files)
        router.add_api_route(
            "/{mission}/recording", self.delete_recording, methods=["DELETE"], status_code=204
        )
        router.add_api_route("/{mission}/rehearsal.png", self.picture, **files)
        return router

    def submit(
        self,
        wanted: MissionIn,
        request: Request,
        idempotency_key: Annotated[str | None, Header()] = None,
    ) -> MissionOut:
        """Submit a mission document to be rehearsed and flown.

        The same document with the same `Idempotency-Key` is the same mission, however often it
        is sent.
        """
        scope = Scope.FLY if wanted.attach is None else Scope.SENSE
        principal = self._admission.require(request, Role.PILOT, scope)
        with self._admission.auditing(principal, request):
            found = self._missions.submit(principal, wanted, _key(idempotency_key))
        self._audit.write(principal, "mission.submit", found.id, found.name, accepted=True)
        return found

    def cancel(self, mission: str, request: Request) -> MissionOut:
        """Cancel a mission; drones in flight come home."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY, agents=True)
        with self._admission.auditing(principal, request):
            found = self._missions.cancel(principal, mission)
        self._audit.write(principal, "mission.cancel", mission, accepted=True, required=False)
        return found

    def approve(
        self, mission: str, request: Request, approval: ApprovalIn | None = None
    ) -> MissionOut:
        """Approve a mission that waits for an operator; of a proposal, exactly what was shown."""
        principal = self._admission.require(request, Role.OPERATOR)
        with self._admission.auditing(principal, request):
            found = self._missions.approve(principal, mission, approval)
        told = "" if approval is None else approval.hash
        self._audit.write(principal, "mission.approve", mission, told, accepted=True)
        return found

    def grant(self, mission: str, tenant: Word, body: GrantIn, request: Request) -> MissionOut:
        """Let a tenant attach missions to this one's cameras, and no others than these."""
        principal = self._admission.require(request, Role.PILOT, Scope.SENSE)
        with self._admission.auditing(principal, request):
            found = self._missions.grant(principal, mission, tenant, body.sensors)
        said = f"to {tenant}: {', '.join(body.sensors) or 'all cameras'}"
        self._audit.write(principal, "mission.grant", mission, said, accepted=True)
        return found

    def withdraw(self, mission: str, tenant: Word, request: Request) -> MissionOut:
        """Withdraw what a tenant was granted; what it has attached gets no further picture."""
        principal = self._admission.require(request, Role.PILOT)
        with self._admission.auditing(principal, request):
            found = self._missions.grant(principal, mission, tenant, None)
        said = f"from {tenant}"
        self._audit.write(
            principal, "mission.withdraw", mission, said, accepted=True, required=False
        )
        return found

    def recording(self, mission: str, request: Request) -> FileResponse:
        """The flight's recording, an MCAP file, once it is over."""
        principal = self._admission.require(request, Role.VIEWER, Scope.SENSE, agents=True)
        path = self._missions.file(principal, mission, "recording")
        return FileResponse(path, media_type="application/octet-stream", filename=f"{mission}.mcap")

    def delete_recording(self, mission: str, request: Request) -> None:
        """Remove the recording of a mission that is over."""
        principal = self._admission.require(request, Role.PILOT, Scope.SENSE)
        with self._admission.auditing(principal, request):
            self._missions.delete_recording(principal, mission)
        self._audit.write(principal, "recording.delete", mission, accepted=True)

    def picture(self, mission: str, request: Request) -> FileResponse:
        """Picture of the rehearsed flight."""
        principal = self._admission.require(request, Role.VIEWER, agents=True)
        return FileResponse(
            self._missions.file(principal, mission, "picture"), media_type="image/png"
        )


def _key(header: str | None) -> str | None:
    """The key in a request's header field; raises RefusedError for a malformed one."""
    if header is None:
        return None
    found = _STRING.fullmatch(header.strip(" "))
    if found is None:
        raise RefusedError(
            400,
            "Idempotency-Key is one string of 1 to 255 characters in quotation marks, such as "
            '"8e03978e-40d5-43dd-bc93-6894a57f9324"',
        )
    return re.sub(r"\\(.)", r"\1", found[1])
