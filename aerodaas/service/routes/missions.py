"""Missions: submission, commands, recordings."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, BackgroundTasks, Header, Request
from fastapi.responses import FileResponse, Response

from aerodaas.analytics.remote.schemas import AnswerOut
from aerodaas.console.playback import (
    Moment,
    Player,
    Players,
    Stream,
    flight_answer,
    picture_answer,
)
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    CommandIn,
    GrantIn,
    MissionIn,
    MissionOut,
    NavigationIn,
    Role,
    Scope,
    Word,
)
from aerodaas.service.access import Audit
from aerodaas.service.desk import MissionDesk
from aerodaas.service.idempotency import read_key
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.bodies import BoundedRoute

__all__ = ["MissionRoutes"]


class MissionRoutes:
    """Routes below `/v1/missions`."""

    def __init__(self, desk: MissionDesk, admission: Admission, audit: Audit) -> None:
        """Answer from the desk."""
        self._desk = desk
        self._admission = admission
        self._audit = audit
        self._players = Players()

    def router(self) -> APIRouter:
        """The routes."""
        router = APIRouter(prefix="/v1/missions", tags=["missions"], route_class=BoundedRoute)
        router.add_api_route("", self.submit, methods=["POST"], status_code=202)
        router.add_api_route("", self.missions)
        router.add_api_route("/{mission}", self.mission)
        router.add_api_route("/{mission}/scenery", self.scenery)
        router.add_api_route("/{mission}", self.cancel, methods=["DELETE"])
        router.add_api_route("/{mission}/approve", self.approve, methods=["POST"])
        router.add_api_route("/{mission}/commands", self.command, methods=["POST"])
        router.add_api_route("/{mission}/navigation", self.navigation, methods=["POST"])
        grants = "/{mission}/grants/{tenant}"
        router.add_api_route(grants, self.grant, methods=["PUT"])
        router.add_api_route(grants, self.withdraw, methods=["DELETE"])
        files: dict[str, Any] = {"response_class": FileResponse}
        router.add_api_route("/{mission}/recording", self.recording, **files)
        router.add_api_route(
            "/{mission}/recording", self.delete_recording, methods=["DELETE"], status_code=204
        )
        router.add_api_route("/{mission}/rehearsal.png", self.picture, **files)
        bare: dict[str, Any] = {"response_model": None}
        router.add_api_route("/{mission}/playback", self.playback, **bare)
        router.add_api_route("/{mission}/playback/picture", self.moment, **bare)
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
            found = self._desk.submit(principal, wanted, read_key(idempotency_key))
        self._audit.write(principal, "mission.submit", found.id, found.name, accepted=True)
        return found

    def missions(self, request: Request) -> list[MissionOut]:
        """All missions that the account may see, newest first."""
        return self._desk.missions(self._admission.require(request, Role.VIEWER))

    def mission(self, mission: str, request: Request) -> MissionOut:
        """One mission with its newest state."""
        principal = self._admission.require(request, Role.VIEWER)
        found = self._desk.mission(principal, mission)
        if self._desk.flies(principal, mission):
            self._desk.hear(mission)
        return found

    def scenery(self, mission: str, request: Request) -> SceneryOut:
        """What lies below a mission on the map."""
        return self._desk.scenery(self._admission.require(request, Role.VIEWER), mission)

    def cancel(self, mission: str, request: Request) -> MissionOut:
        """Cancel a mission; drones in flight come home."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        with self._admission.auditing(principal, request):
            found = self._desk.cancel(principal, mission)
        self._audit.write(principal, "mission.cancel", mission, accepted=True, required=False)
        return found

    def approve(self, mission: str, request: Request) -> MissionOut:
        """Approve a mission that waits for an operator."""
        principal = self._admission.require(request, Role.OPERATOR)
        with self._admission.auditing(principal, request):
            found = self._desk.approve(principal, mission)
        self._audit.write(principal, "mission.approve", mission, accepted=True)
        return found

    def grant(self, mission: str, tenant: Word, body: GrantIn, request: Request) -> MissionOut:
        """Let a tenant attach missions to this one's cameras, and no others than these."""
        principal = self._admission.require(request, Role.PILOT, Scope.SENSE)
        with self._admission.auditing(principal, request):
            found = self._desk.grant(principal, mission, tenant, body.sensors)
        said = f"to {tenant}: {', '.join(body.sensors) or 'all cameras'}"
        self._audit.write(principal, "mission.grant", mission, said, accepted=True)
        return found

    def withdraw(self, mission: str, tenant: Word, request: Request) -> MissionOut:
        """Withdraw what a tenant was granted; what it has attached gets no further picture."""
        principal = self._admission.require(request, Role.PILOT)
        with self._admission.auditing(principal, request):
            found = self._desk.grant(principal, mission, tenant, None)
        said = f"from {tenant}"
        self._audit.write(
            principal, "mission.withdraw", mission, said, accepted=True, required=False
        )
        return found

    def command(
        self, mission: str, body: CommandIn, request: Request, later: BackgroundTasks
    ) -> AnswerOut:
        """Give one of the mission's robots a command; answers what the drone said."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        with self._admission.auditing(principal, request):
            answer = self._desk.command(principal, mission, body)
        later.add_task(
            self._audit.note_answer, principal, body.command, f"{mission}/{body.robot}", answer
        )
        return answer

    def navigation(
        self, mission: str, body: NavigationIn, request: Request, later: BackgroundTasks
    ) -> AnswerOut:
        """Add waypoints to the queue of one of the mission's robots."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        with self._admission.auditing(principal, request):
            answer = self._desk.fly(principal, mission, body)
        later.add_task(
            self._audit.note_answer, principal, "navigation", f"{mission}/{body.robot}", answer
        )
        return answer

    def recording(self, mission: str, request: Request) -> FileResponse:
        """The flight's recording, an MCAP file, once it is over."""
        principal = self._admission.require(request, Role.VIEWER, Scope.SENSE)
        path = self._desk.file(principal, mission, "recording")
        return FileResponse(path, media_type="application/octet-stream", filename=f"{mission}.mcap")

    def delete_recording(self, mission: str, request: Request) -> None:
        """Remove the recording of a mission that is over."""
        principal = self._admission.require(request, Role.PILOT, Scope.SENSE)
        with self._admission.auditing(principal, request):
            self._desk.delete_recording(principal, mission)
        self._audit.write(principal, "recording.delete", mission, accepted=True)

    def picture(self, mission: str, request: Request) -> FileResponse:
        """Picture of the rehearsed flight."""
        principal = self._admission.require(request, Role.VIEWER)
        return FileResponse(self._desk.file(principal, mission, "picture"), media_type="image/png")

    def playback(self, mission: str, request: Request) -> Response:
        """The recorded flight as a page plays it, once it is over; how far it has been read."""
        return flight_answer(self._player(mission, request))

    def moment(
        self,
        mission: str,
        request: Request,
        stream: Stream,
        at: Moment,
        depth: bool = False,  # noqa: FBT001, FBT002 - of an address
    ) -> Response:
        """The last picture of a stream captured at or before a mission time, in nanoseconds.

        One line of JSON with what was found in it and the picture's header; after it its depth as a
        PNG, if wanted and measured, and a JPEG.
        """
        return picture_answer(self._player(mission, request), stream, at, depth=depth)

    def _player(self, mission: str, request: Request) -> Player:
        principal = self._admission.require(request, Role.VIEWER, Scope.SENSE)
        return self._players.of(mission, self._desk.file(principal, mission, "recording"))
