"""Missions: submission, commands, recordings."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.responses import FileResponse
from pydantic import Field

from aerodaas.analytics.remote.schemas import AnswerOut, WaypointsIn
from aerodaas.service.access import Audit, Principal
from aerodaas.service.desk import MissionDesk
from aerodaas.service.routes.admission import Admission
from aerodaas.service.schemas import CommandIn, MissionIn, MissionOut, Role, Scope, Word

__all__ = ["missions_router"]


class NavigationIn(WaypointsIn):
    """Waypoints for one robot of a mission."""

    robot: Annotated[Word, Field()]


def missions_router(desk: MissionDesk, admission: Admission, audit: Audit) -> APIRouter:
    """Routes below `/v1/missions`."""
    router = APIRouter(prefix="/v1/missions", tags=["missions"])
    viewer = Depends(admission.needs(Role.VIEWER))
    pilot = Depends(admission.needs(Role.PILOT, Scope.FLY))
    operator = Depends(admission.needs(Role.OPERATOR))
    sensing = Depends(admission.needs(Role.VIEWER, Scope.SENSE))

    def note(principal: Principal, action: str, target: str, answer: AnswerOut) -> AnswerOut:
        audit.write(
            principal, action, target, answer.text, accepted=answer.accepted, required=False
        )
        return answer

    @router.post("", status_code=202)
    def submit(wanted: MissionIn, principal: Annotated[Principal, pilot]) -> MissionOut:
        """Submit a mission document to be rehearsed and flown."""
        found = desk.submit(principal, wanted)
        audit.write(principal, "mission.submit", found.id, found.name, accepted=True)
        return found

    @router.get("")
    def missions(principal: Annotated[Principal, viewer]) -> list[MissionOut]:
        """All missions that the account may see, newest first."""
        return desk.missions(principal)

    @router.get("/{mission}")
    def one(mission: str, principal: Annotated[Principal, viewer]) -> MissionOut:
        """One mission with its newest state."""
        found = desk.mission(principal, mission)
        if desk.flies(principal, mission):
            desk.hear(mission)
        return found

    @router.delete("/{mission}")
    def cancel(mission: str, principal: Annotated[Principal, pilot]) -> MissionOut:
        """Cancel a mission; drones in flight come home."""
        found = desk.cancel(principal, mission)
        audit.write(principal, "mission.cancel", mission, accepted=True, required=False)
        return found

    @router.post("/{mission}/approve")
    def approve(mission: str, principal: Annotated[Principal, operator]) -> MissionOut:
        """Approve a mission that waits for an operator."""
        found = desk.approve(principal, mission)
        audit.write(principal, "mission.approve", mission, accepted=True)
        return found

    @router.post("/{mission}/commands")
    def command(
        mission: str, body: CommandIn, principal: Annotated[Principal, pilot]
    ) -> AnswerOut:
        """Give one of the mission's robots a command; answers what the drone said."""
        answer = desk.command(principal, mission, body)
        return note(principal, f"mission.{body.command}", f"{mission}/{body.robot}", answer)

    @router.post("/{mission}/navigation")
    def navigation(
        mission: str, body: NavigationIn, principal: Annotated[Principal, pilot]
    ) -> AnswerOut:
        """Add waypoints to the queue of one of the mission's robots."""
        waypoints = WaypointsIn(
            waypoints=body.waypoints, ordered=body.ordered, index=body.index
        )
        answer = desk.fly(principal, mission, body.robot, waypoints)
        return note(principal, "mission.navigation", f"{mission}/{body.robot}", answer)

    @router.get("/{mission}/recording", response_class=FileResponse)
    def recording(mission: str, principal: Annotated[Principal, sensing]) -> FileResponse:
        """The flight's recording, an MCAP file, once it is over."""
        path = desk.file(principal, mission, "recording")
        return FileResponse(path, media_type="application/octet-stream", filename=f"{mission}.mcap")

    @router.get("/{mission}/rehearsal.png", response_class=FileResponse)
    def picture(mission: str, principal: Annotated[Principal, viewer]) -> FileResponse:
        """Picture of the rehearsed flight."""
        return FileResponse(desk.file(principal, mission, "picture"), media_type="image/png")

    return router
