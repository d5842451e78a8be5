"""Live view of a mission: its state at each change, and the items of its streams."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter, WebSocket

from aerodaas.console.hub import StreamHub
from aerodaas.console.live import Form, LiveSession, Rate, StreamNames, wanted_streams
from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.schemas import PictureForm, Role, Scope
from aerodaas.service.desk import MissionDesk
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.refusals import refuse

__all__ = ["LiveRoutes"]


class LiveRoutes:
    """Route `/v1/missions/{id}/live`."""

    def __init__(self, desk: MissionDesk, hub: StreamHub, admission: Admission) -> None:
        """Show the desk's missions, and the hub's streams."""
        self._desk = desk
        self._hub = hub
        self._admission = admission

    def router(self) -> APIRouter:
        """The route."""
        router = APIRouter()
        router.add_api_websocket_route("/v1/missions/{mission}/live", self.live)
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
            principal = self._admission.require(socket, Role.VIEWER, scope)
            await asyncio.to_thread(self._desk.mission, principal, mission)
            own = await asyncio.to_thread(self._desk.flies, principal, mission)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return

        def allowed() -> bool:
            return self._admission.stays(
                socket, Role.VIEWER, scope, lambda who: self._desk.mission(who, mission)
            )

        session = LiveSession(socket, self._desk, self._hub, mission)
        await session.run(rate, wanted, own=own, allowed=allowed)
