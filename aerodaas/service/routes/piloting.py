"""What a pilot does with a flying mission: surveys, the order of waypoints, control by hand."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, BackgroundTasks, Request, Security, WebSocket
from fastapi.security import HTTPBearer

from aerodaas.analytics.remote.schemas import AnswerOut
from aerodaas.console.controls import ControlCommand, ControlSession, told_of_controls
from aerodaas.console.surveys import SurveyPlanner
from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.piloting import ActuateIn, ControlsIn, RearrangeIn, SurveyIn, SurveyOut
from aerodaas.protocol.schemas import Role, Scope, Word
from aerodaas.service.access import Audit
from aerodaas.service.desk import MissionDesk
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.bodies import BoundedRoute
from aerodaas.service.routes.refusals import refuse

__all__ = ["PilotingRoutes"]


class PilotingRoutes:
    """Routes `/v1/missions/{id}/survey`, `plan`, `actuators` and `controls`."""

    def __init__(self, desk: MissionDesk, admission: Admission, audit: Audit) -> None:
        """Command the desk's missions."""
        self._desk = desk
        self._admission = admission
        self._audit = audit
        self._surveys = SurveyPlanner()

    def router(self) -> APIRouter:
        """The routes."""
        router = APIRouter(prefix="/v1/missions", tags=["missions"], route_class=BoundedRoute)
        secured = [Security(HTTPBearer(auto_error=False))]
        posted: dict[str, Any] = {"methods": ["POST"], "dependencies": secured}
        router.add_api_route("/{mission}/survey", self.survey, **posted)
        router.add_api_route("/{mission}/plan", self.rearrange, **posted)
        router.add_api_route("/{mission}/actuators", self.actuate, **posted)
        router.add_api_websocket_route("/{mission}/controls", self.controls)
        return router

    def survey(self, mission: str, body: SurveyIn, request: Request) -> SurveyOut:
        """Plan the survey of an area by one of the mission's robots; nothing is flown."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        config = environment_of(self._desk.order(principal, mission))
        status = self._desk.shown(mission).status.get(body.robot)
        return self._surveys.plan(body, config, status)

    def rearrange(
        self, mission: str, body: RearrangeIn, request: Request, later: BackgroundTasks
    ) -> AnswerOut:
        """Change the order of a robot's coming waypoints, or remove some."""
        return self._flown(request, later, mission, body, "plan", f"{mission}/{body.robot}")

    def actuate(
        self, mission: str, body: ActuateIn, request: Request, later: BackgroundTasks
    ) -> AnswerOut:
        """Move an actuator that the provider lets this tenant move."""
        about = f"{mission}/{body.robot}/{body.actuator}"
        return self._flown(request, later, mission, body, "actuate", about)

    def _flown(
        self,
        request: Request,
        later: BackgroundTasks,
        mission: str,
        body: RearrangeIn | ActuateIn,
        action: str,
        about: str,
    ) -> AnswerOut:
        """Have a mission's robot do what a pilot may ask; audited as `action`, `about` that."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        with self._admission.auditing(principal, request):
            answer = self._desk.fly(principal, mission, body)
        later.add_task(self._audit.note_answer, principal, action, about, answer)
        return answer

    async def controls(self, socket: WebSocket, mission: str, robot: Word) -> None:
        """Have a robot flown by hand, until the sender lets go or falls silent."""
        try:
            principal = self._admission.require(socket, Role.PILOT, Scope.FLY)
            with self._admission.auditing(principal, socket):
                await asyncio.to_thread(self._desk.order, principal, mission)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return

        def give(command: ControlCommand) -> AnswerOut:
            what = ControlsIn.of(robot, command)
            # As the account is now: an operator's hand does not outlive the role.
            sender = self._admission.require(socket, Role.PILOT, Scope.FLY)
            answer = self._desk.fly(sender, mission, what)
            if told_of_controls(command):
                self._audit.note_answer(sender, "controls", f"{mission}/{robot}", answer)
            return answer

        def renew() -> None:
            self._admission.enter(socket)
            self._admission.require(socket, Role.PILOT, Scope.FLY)

        await ControlSession(socket, principal.account, give, renew).run()
