"""The user's side of a mission: questions of its flight go out, answers come in."""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from aerodaas.analytics.guests.channel import GuestError
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.desk import MissionDesk
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.async_channel import AsyncChannel
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.refusals import refuse
from aerodaas.types.errors import AeroDaaSError

__all__ = ["HereRoutes"]

_AGAIN_SECONDS = 0.5


class HereRoutes:
    """Route `/v1/missions/{id}/here`.

    A message is a text with JSON, followed by a binary one if its `blob` is true. The connection
    may be made before the flight begins, and ends with it.
    """

    def __init__(self, desk: MissionDesk, admission: Admission) -> None:
        """Connect users with the desk's flights."""
        self._desk = desk
        self._admission = admission

    def router(self) -> APIRouter:
        """The route."""
        router = APIRouter()
        router.add_api_websocket_route("/v1/missions/{mission}/here", self.here)
        return router

    async def here(self, socket: WebSocket, mission: str) -> None:
        """Carry questions and answers until the mission is over or the user leaves."""
        try:
            principal = self._admission.require(socket, Role.PILOT, Scope.COMPUTE)
            found = await asyncio.to_thread(self._desk.mission, principal, mission)
            if found.tenant != principal.tenant:
                raise RefusedError(403, f"{mission} is {found.tenant}'s")
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return
        await socket.accept()
        try:
            await self._carry(socket, mission)
        finally:
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await socket.close()

    async def _carry(self, socket: WebSocket, mission: str) -> None:
        """Connect the user with the mission's flight, again if need be, until it is over."""
        while not self._desk.shown(mission).phase.over:
            folder = self._desk.flight(mission)
            try:
                if folder is not None and not await _carried(socket, folder):
                    return
            except GuestError:
                # The flight has not begun to listen, or has ended.
                pass
            await asyncio.sleep(_AGAIN_SECONDS)


async def _carried(socket: WebSocket, folder: FlightFolder) -> bool:
    """Carry messages until one side has gone; returns whether the user is still there."""
    channel = await AsyncChannel.connect(folder, "here")
    questions = asyncio.create_task(_ask(socket, channel))
    answers = asyncio.create_task(_answer(socket, channel))
    try:
        await asyncio.wait((questions, answers), return_when=asyncio.FIRST_COMPLETED)
        return not answers.done()
    finally:
        channel.close()
        questions.cancel()
        answers.cancel()
        await asyncio.gather(questions, answers, return_exceptions=True)


async def _ask(socket: WebSocket, channel: AsyncChannel) -> None:
    """Carry questions to the user; raises GuestError when the flight has ended."""
    while True:
        question, blob = await channel.receive()
        await socket.send_text(json.dumps({**question, "blob": bool(blob)}))
        if blob:
            await socket.send_bytes(blob)


async def _answer(socket: WebSocket, channel: AsyncChannel) -> None:
    """Carry answers to the flight; raises WebSocketDisconnect when the user has gone."""
    while True:
        answer = _object(await socket.receive_text())
        blob = await socket.receive_bytes() if answer.pop("blob", False) else b""
        await channel.send(answer, blob)


def _object(text: str) -> dict[str, Any]:
    """A JSON object; an empty one for anything else, which the flight takes for no answer."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
