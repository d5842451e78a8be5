"""Live view of a mission: its state at each change, and the items of its streams."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Annotated

from fastapi import APIRouter, Query, WebSocket, WebSocketDisconnect

from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.desk import MissionDesk
from aerodaas.service.hub import StreamHub, Watcher
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.refusals import refuse
from aerodaas.types.errors import AeroDaaSError

__all__ = ["LiveRoutes"]

_MOST_STREAMS = 16
_IDLE_SECONDS = 1.0
"""Most seconds between two messages of a mission that does not change."""


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
        wanted = [name for name in streams.split(",") if name][:_MOST_STREAMS]
        try:
            scope = Scope.SENSE if wanted else None
            principal = self._admission.require(socket, Role.VIEWER, scope)
            await asyncio.to_thread(self._desk.mission, principal, mission)
            own = await asyncio.to_thread(self._desk.flies, principal, mission)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return
        await socket.accept()
        session = _Session(socket, self._desk, self._hub, mission)
        state = asyncio.create_task(session.state(rate, own=own))
        gone = asyncio.create_task(session.read())
        jobs = [state, gone, *(asyncio.create_task(session.items(name)) for name in wanted)]
        try:
            await asyncio.wait((state, gone), return_when=asyncio.FIRST_COMPLETED)
        finally:
            for job in jobs:
                job.cancel()
            await asyncio.gather(*jobs, return_exceptions=True)
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await socket.close()


class _Session:
    """One watcher's connection."""

    def __init__(self, socket: WebSocket, desk: MissionDesk, hub: StreamHub, mission: str) -> None:
        self._socket = socket
        self._desk = desk
        self._hub = hub
        self._mission = mission
        # An item's two messages stay together.
        self._sending = asyncio.Lock()

    async def state(self, rate: float, *, own: bool) -> None:
        """Send the mission's state until it is over; its own user counts as present meanwhile."""
        sent, since, heard = -1, 0.0, 0.0
        loop = asyncio.get_running_loop()
        while True:
            now, version = loop.time(), self._desk.version(self._mission)
            if own and now - heard > _IDLE_SECONDS:
                heard = now
                await asyncio.to_thread(self._desk.hear, self._mission)
            if version != sent or now - since > _IDLE_SECONDS:
                sent, since = version, now
                text, over = self._desk.text(self._mission)
                async with self._sending:
                    await self._socket.send_text(f'{{"kind": "mission", "mission": {text}}}')
                    if over:
                        await self._socket.send_text('{"kind": "end"}')
                        return
            await asyncio.sleep(1.0 / rate)

    async def items(self, stream: str) -> None:
        """Send the items of one stream; begins again where the flight has not begun yet."""
        while True:
            watcher = self._hub.watch(self._mission, stream)
            try:
                await self._forward(watcher)
            finally:
                self._hub.leave(self._mission, stream, watcher)
            await asyncio.sleep(_IDLE_SECONDS / 2)

    async def _forward(self, watcher: Watcher) -> None:
        while (found := await watcher.next()) is not None:
            message, blob = found
            async with self._sending:
                await self._socket.send_json(message)
                if blob:
                    await self._socket.send_bytes(blob)

    async def read(self) -> None:
        """Return when the watcher has gone; it has nothing to say."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await self._socket.receive_text()
