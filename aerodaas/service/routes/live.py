"""Live view of a mission: its state at each change, and the items of its streams."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Query, WebSocket

from aerodaas.console.hub import StreamHub
from aerodaas.console.live import LiveSession, wanted_streams
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.desk import MissionDesk
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.refusals import refuse
from aerodaas.types.errors import AeroDaaSError

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
        rate: Annotated[float, Query(gt=0, le=20, allow_inf_nan=False)] = 5.0,
        streams: Annotated[str, Query(max_length=2000)] = "",
    ) -> None:
        """Send the mission's state, at most `rate` times a second, and items of `streams`."""
        wanted = wanted_streams(streams)
        try:
            scope = Scope.SENSE if wanted else None
            principal = self._admission.require(socket, Role.VIEWER, scope)
            await asyncio.to_thread(self._desk.mission, principal, mission)
            own = await asyncio.to_thread(self._desk.flies, principal, mission)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return
        await LiveSession(socket, self._desk, self._hub, mission).run(rate, wanted, own=own)
