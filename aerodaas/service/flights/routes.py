"""Routes of a flight's process for its service alone: lease, presence, shared cameras, user's side.

They stand beside those that any flight has, below its one mission `own`.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any

from fastapi import APIRouter, Request, WebSocket, WebSocketDisconnect

from aerodaas.analytics.here.relay import HereRelay
from aerodaas.clock import host_time_ns
from aerodaas.errors import AeroDaaSError, MissionError
from aerodaas.mission.commands import Answer
from aerodaas.protocol.piloting import ControlsIn
from aerodaas.protocol.schemas import FlightLeaseIn, GrantIn, Role, Scope
from aerodaas.service.flights.server import LeasedFlight, LeaseWatch
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.refusals import refuse
from aerodaas.service.live.packed_reader import PackedReader
from aerodaas.service.live.session import end_jobs
from aerodaas.service.own.access import OWN

__all__ = ["FlightRoutes"]

_QUESTIONS = 64
"""Questions to the user's side that wait to be sent; a fuller queue refuses them."""
_PICTURE_SECONDS = 0.2
"""Longest wait for a picture that is asked for."""


class FlightRoutes:
    """Routes `controls`, `lease`, `presence`, `shares` and `here` below `/v1/missions/own`."""

    def __init__(
        self, flight: LeasedFlight, lease: LeaseWatch, relay: HereRelay, admission: Admission
    ) -> None:
        """Serve a flight under a lease, whose nodes ask the user's side by `relay`."""
        self._flight = flight
        self._lease = lease
        self._relay = relay
        self._admission = admission
        self._shared: dict[str, frozenset[str]] = {}
        """Cameras by attached mission; asked before each picture, beside the drone: what is
        withdrawn ends here, whatever becomes of the service and of that mission's process."""

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router(f"/v1/missions/{OWN}", "flight")
        router.add_api_route("/controls", self.control, methods=["POST"])
        router.add_api_route("/presence", self.record_presence, methods=["POST"])
        router.add_api_route("/lease", self.change_lease, methods=["PUT"])
        router.add_api_route("/shares/{attached}", self.share, methods=["PUT"])
        router.add_api_route("/shares/{attached}", self.withdraw, methods=["DELETE"])
        router.add_api_websocket_route("/shares/{attached}", self.pictures)
        router.add_api_websocket_route("/here", self.here)
        return router

    def control(self, body: ControlsIn, request: Request) -> Answer:
        """Fly a robot by hand, or let go of it."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY)
        return self._flight.fly(principal, OWN, body)

    def record_presence(self, request: Request) -> Answer:
        """Record that the user is there."""
        self._admission.require(request, Role.OPERATOR)
        self._lease.record_presence()
        return Answer(accepted=True)

    def change_lease(self, body: FlightLeaseIn, request: Request) -> Answer:
        """Move the end of the lease, or end it: then the drones come home."""
        self._admission.require(request, Role.OPERATOR)
        if body.ends is None:
            self._lease.end(body.reason)
        elif not self._lease.extend(body.ends):
            return Answer(accepted=False, text=self._lease.reason)
        return Answer(accepted=True)

    def share(self, attached: str, body: GrantIn, request: Request) -> Answer:
        """Share cameras with a mission, as long as the lease is good."""
        self._admission.require(request, Role.OPERATOR)
        if self._lease.reason:
            return self._flight.refusal()
        self._shared[attached] = frozenset(body.sensors)
        return Answer(accepted=True)

    def withdraw(self, attached: str, request: Request) -> Answer:
        """Share nothing with a mission any more."""
        self._admission.require(request, Role.OPERATOR)
        self._shared.pop(attached, None)
        return Answer(accepted=True)

    async def pictures(self, socket: WebSocket, attached: str, stream: str) -> None:
        """Answer each message of an attached mission by the newest picture of a camera."""
        try:
            self._admission.require(socket, Role.VIEWER, Scope.SENSE)
            reader = await asyncio.to_thread(self._reader, attached, stream)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return
        await socket.accept()
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await socket.receive_text()
                found = await asyncio.to_thread(reader.latest_packed, _PICTURE_SECONDS)
                # After the wait: what was withdrawn meanwhile is not sent.
                if self._flight.over or not self._allows(attached, stream):
                    break
                message, blob = found if found is not None else ({}, b"")
                if "captured" in message:
                    # The other process may count host time from elsewhere.
                    message["age"] = max(0, host_time_ns() - message["captured"])
                await socket.send_text(json.dumps(message))
                if blob:
                    await socket.send_bytes(blob)
            await socket.close()

    def _allows(self, attached: str, stream: str) -> bool:
        """Whether a mission may have the next picture of a camera."""
        return stream in self._shared.get(attached, ())

    def _reader(self, attached: str, stream: str) -> PackedReader:
        if not self._allows(attached, stream):
            raise MissionError(f"{stream} is not shared with {attached}")
        return self._flight.reader(stream)

    async def here(self, socket: WebSocket) -> None:
        """Connect the user's side: questions of the flight go out, answers come in."""
        try:
            self._admission.require(socket, Role.PILOT, Scope.COMPUTE)
        except AeroDaaSError as error:
            await refuse(socket.scope, socket.send, error)
            return
        await socket.accept()
        questions: asyncio.Queue[tuple[dict[str, Any], bytes]] = asyncio.Queue()
        loop = asyncio.get_running_loop()

        def send(question: dict[str, Any], blob: bytes) -> None:
            if questions.qsize() >= _QUESTIONS:
                raise MissionError(f"{_QUESTIONS} questions wait to be sent")
            loop.call_soon_threadsafe(questions.put_nowait, (question, blob))

        async def ask() -> None:
            while True:
                question, blob = await questions.get()
                await socket.send_text(json.dumps({**question, "blob": bool(blob)}))
                if blob:
                    await socket.send_bytes(blob)

        async def answer() -> None:
            while True:
                text = await socket.receive_text()
                # Its parsing may take long.
                await asyncio.to_thread(user.answered_text, text.encode())

        user = self._relay.attach(send)
        asking, answering = asyncio.create_task(ask()), asyncio.create_task(answer())
        try:
            await asyncio.wait((asking, answering), return_when=asyncio.FIRST_COMPLETED)
        finally:
            await asyncio.to_thread(user.detach)
            await end_jobs("the way to the user's side", [asking], [answering])
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await socket.close()
