"""The user's side of a mission: questions of its flight go out, answers come in."""

from __future__ import annotations

import asyncio
import contextlib

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import WebSocketException

from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.access.principal import Principal
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.link import flight_address
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.refusals import refuse
from aerodaas.service.live.session import end_jobs, until_refused
from aerodaas.service.mission_service import MissionService

__all__ = ["HereRoutes"]

_AGAIN_SECONDS = 0.5


class HereRoutes:
    """Route `/v1/missions/{id}/here`.

    A question is a text with JSON, followed by a binary message if its `blob` is true; an answer
    is a text alone. The connection may be made before the flight begins, and ends with it.
    """

    def __init__(self, missions: MissionService, admission: Admission) -> None:
        """Connect users with the flights of `missions`."""
        self._missions = missions
        self._admission = admission

    def router(self) -> APIRouter:
        """The route."""
        router = APIRouter()
        router.add_api_websocket_route("/v1/missions/{mission}/here", self.here)
        return router

    async def here(self, socket: WebSocket, mission: str) -> None:
        """Carry questions and answers until the mission is over, or the user leaves or must go."""

        def require_user(principal: Principal) -> None:
            self._missions.require_users_side(principal, mission)

        def allowed() -> bool:
            return self._admission.stays(socket, Role.PILOT, Scope.COMPUTE, require_user)

        try:
            principal = self._admission.require(socket, Role.PILOT, Scope.COMPUTE)
            with self._admission.auditing(principal, socket):
                await asyncio.to_thread(require_user, principal)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return
        await socket.accept()
        user = _User(socket)
        asking = asyncio.create_task(self._carry(user, mission))
        answering = asyncio.create_task(user.answer())
        refused = asyncio.create_task(until_refused(allowed))
        try:
            jobs = (asking, answering, refused)
            await asyncio.wait(jobs, return_when=asyncio.FIRST_COMPLETED)
        finally:
            what = f"{mission}: the way to its user's side"
            await end_jobs(what, [asking, refused], [answering])
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await socket.close()

    async def _carry(self, user: _User, mission: str) -> None:
        """Connect the user with the mission's flight, again if need be, until it is over."""
        while not self._missions.shown(mission).phase.over:
            folder = self._missions.flight(mission)
            if folder is not None:
                # The flight may not have begun to listen, or have ended.
                with contextlib.suppress(OSError, EOFError, WebSocketException):
                    await user.be_asked(folder)
            await asyncio.sleep(_AGAIN_SECONDS)


class _User:
    """The user's side, connected with a flight or waiting for one.

    What is said is passed on as it is: who parses what a user has sent is the user's own flight.
    """

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._flight: ClientConnection | None = None

    async def be_asked(self, folder: FlightFolder) -> None:
        """Carry questions to the user until the flight has ended; raises what that raises."""
        address = flight_address("here", Role.PILOT)
        async with unix_connect(str(folder.socket), **address) as flight:
            self._flight = flight
            try:
                async for part in flight:
                    if isinstance(part, str):
                        await self._socket.send_text(part)
                    else:
                        await self._socket.send_bytes(part)
            finally:
                self._flight = None

    async def answer(self) -> None:
        """Carry answers to the flight; ends with the user, or what no user's side would say.

        It always listens: who has gone is noticed before the flight begins, too.
        """
        while True:
            answer = await self._socket.receive_text()
            if self._flight is not None:
                with contextlib.suppress(WebSocketException):
                    await self._flight.send(answer)
