"""The user's side of a mission: questions of its flight go out, answers come in."""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from aerodaas.analytics.guests.channel import Channel, GuestError
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.desk import MissionDesk
from aerodaas.service.errors import RefusedError
from aerodaas.service.phases import OVER
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.refusals import close_refused
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
            await close_refused(socket, error)
            return
        await socket.accept()
        answers = asyncio.create_task(self._answers(socket, mission))
        try:
            await answers
        finally:
            answers.cancel()
            with contextlib.suppress(RuntimeError):
                await socket.close()

    async def _answers(self, socket: WebSocket, mission: str) -> None:
        while self._desk.shown(mission).phase not in OVER:
            channel = await asyncio.to_thread(self._desk.here, mission)
            if channel is None:
                await asyncio.sleep(_AGAIN_SECONDS)
                continue
            carried = [
                asyncio.create_task(_ask(socket, channel)),
                asyncio.create_task(_answer(socket, channel)),
            ]
            done, _ = await asyncio.wait(carried, return_when=asyncio.FIRST_COMPLETED)
            channel.close()
            for task in carried:
                task.cancel()
            results = await asyncio.gather(*carried, return_exceptions=True)
            if any(isinstance(one, WebSocketDisconnect) for one in results):
                return
            del done


async def _ask(socket: WebSocket, channel: Channel) -> None:
    """Carry questions to the user; returns when the flight has ended."""
    with contextlib.suppress(GuestError):
        while True:
            question, blob = await asyncio.to_thread(channel.receive)
            await socket.send_text(json.dumps({**question, "blob": bool(blob)}))
            if blob:
                await socket.send_bytes(blob)


async def _answer(socket: WebSocket, channel: Channel) -> None:
    """Carry answers to the flight; raises WebSocketDisconnect when the user has gone."""
    with contextlib.suppress(GuestError):
        while True:
            answer = _object(await socket.receive_text())
            blob = await socket.receive_bytes() if answer.pop("blob", False) else b""
            await asyncio.to_thread(channel.send, answer, blob, 5.0)


def _object(text: str) -> dict[str, Any]:
    """A JSON object; an empty one for anything else, which the flight takes for no answer."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
