"""WebSockets of a mission: its live view, and the controls of a robot by hand."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter, WebSocket

from aerodaas.errors import AeroDaaSError
from aerodaas.mission.commands import Answer
from aerodaas.protocol.piloting import ControlsIn, told_of_controls
from aerodaas.protocol.schemas import PictureForm, Role, Scope, Word
from aerodaas.service.backend import Missions
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.refusals import refuse
from aerodaas.service.live.controls import ControlCommand, ControlSession
from aerodaas.service.live.hub import StreamHub
from aerodaas.service.live.session import Form, LiveSession, Rate, StreamNames, wanted_streams

__all__ = ["LiveRoutes"]


class LiveRoutes:
    """Routes `/v1/missions/{id}/live` and `/v1/missions/{id}/controls`."""

    def __init__(self, missions: Missions, admission: Admission) -> None:
        """Show and command `missions`."""
        self._missions = missions
        self._hub = StreamHub(missions.items)
        self._admission = admission

    def router(self) -> APIRouter:
        """The routes."""
        router = APIRouter(prefix="/v1/missions")
        router.add_api_websocket_route("/{mission}/live", self.live)
        router.add_api_websocket_route("/{mission}/controls", self.controls)
        return router

    async def live(
        self,
        socket: WebSocket,
        mission: str,
        rate: Rate = 5.0,
        streams: StreamNames = "",
        pictures: Form = PictureForm.WHOLE,
        depth: StreamNames = "",
    ) -> None:
        """Send the mission's state, at most `rate` times a second, and items of `streams`.

        Pictures come in a form, with the depth of those that `depth` names beside them.
        """
        wanted = wanted_streams(streams, pictures, depth)
        scope = Scope.SENSE if wanted else None
        try:
            principal = self._admission.require(socket, Role.VIEWER, scope, agents=True)
            await asyncio.to_thread(self._missions.mission, principal, mission)
            own = await asyncio.to_thread(self._missions.flies, principal, mission)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return

        def allowed() -> bool:
            return self._admission.stays(
                socket,
                Role.VIEWER,
                scope,
                lambda who: self._missions.mission(who, mission),
                agents=True,
            )

        session = LiveSession(socket, self._missions, self._hub, mission)
        await session.run(rate, wanted, own=own, allowed=allowed)

    async def controls(self, socket: WebSocket, mission: str, robot: Word) -> None:
        """Have a robot flown by hand, until the sender lets go or falls silent."""
        try:
            principal = self._admission.require(socket, Role.PILOT, Scope.FLY)
            with self._admission.auditing(principal, socket):
                await asyncio.to_thread(self._missions.require_pilot, principal, mission)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return

        def give(command: ControlCommand) -> Answer:
            # As the account is now: an operator's hand does not outlive the role.
            sender = self._admission.require(socket, Role.PILOT, Scope.FLY)
            answer = self._missions.fly(sender, mission, ControlsIn(robot=robot, command=command))
            if told_of_controls(command):
                target = f"{mission}/{robot}"
                self._admission.note_answer(sender, "controls", target, answer)
            return answer

        def renew() -> None:
            self._admission.identify(socket)
            self._admission.require(socket, Role.PILOT, Scope.FLY)

        await ControlSession(socket, principal.account, give, renew).run()
