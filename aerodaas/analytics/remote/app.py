"""Routes of the remote control: request to command, and the mission's answer to JSON."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query, Request, WebSocket, WebSocketDisconnect
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException as AnyHTTPException

from aerodaas.analytics.commanding import MissionLink
from aerodaas.analytics.remote.schemas import AnswerOut, StatusOut, WaypointsIn
from aerodaas.errors import InvalidWaypointError
from aerodaas.http_server.denial import malformed
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.readings import Alert
from aerodaas.mission.commands import (
    Answer,
    ClearNavigation,
    Command,
    End,
    Pause,
    Resume,
    ReturnHome,
)
from aerodaas.mission.state_machine import TERMINAL

__all__ = ["build_app"]

_PATIENCE = 5.0
"""Timeout of an answer from the drone's node in seconds; its loop runs at 20 Hz."""

_COMMANDS: dict[str, tuple[Command, str]] = {
    "pause": (Pause(), "Hover until told to resume."),
    "resume": (Resume(), "Go on where the mission was paused."),
    "clear": (ClearNavigation(), "Empty the queue, hover, and wait for new waypoints."),
    "return-home": (ReturnHome("a remote user asked to return"), "Fly back to take-off and land."),
    "abort": (End("a remote user aborted the mission"), "Land at once, where the drone is."),
}


def build_app(mission: MissionLink, newest_frame: Callable[[], Frame | None]) -> FastAPI:
    """Build the service that commands `mission` and serves its camera's newest image."""
    app = FastAPI(
        title="AeroDaaS remote control", docs_url=None, redoc_url=None, redirect_slashes=False
    )
    app.add_exception_handler(RequestValidationError, _malformed)
    app.add_exception_handler(AnyHTTPException, _failed)
    desk = _Desk(mission, newest_frame)
    answers: dict[str, Any] = {
        "methods": ["POST"],
        "response_model": AnswerOut,
        "responses": {code: {"model": AnswerOut} for code in (400, 401, 409, 422, 504)},
    }
    app.add_api_route("/status", desk.status, response_model=StatusOut)
    app.add_api_route("/frame.jpg", desk.frame, response_class=Response)
    app.add_api_route("/waypoints", desk.add, **answers)
    for name, (command, text) in _COMMANDS.items():
        app.add_api_route(f"/{name}", desk.route(name, command), description=text, **answers)
    app.add_api_websocket_route("/stream", desk.stream)
    return app


class _Desk:
    """Request handlers that forward commands to the mission and await its answers."""

    def __init__(self, mission: MissionLink, newest_frame: Callable[[], Frame | None]) -> None:
        self._mission = mission
        self._newest_frame = newest_frame
        self._count = 0

    def status(self) -> StatusOut:
        """Return the status of mission and vehicle."""
        status = self._mission.status()
        if status is None:
            raise HTTPException(503, "the mission has not said anything yet")
        return StatusOut.of(status, self._mission.vehicle())

    def frame(self) -> Response:
        """Return the camera's newest image as JPEG."""
        picture = self._newest_frame()
        if picture is None:
            raise HTTPException(404, "the camera has not shown anything yet")
        return Response(_jpeg(picture), media_type="image/jpeg")

    async def add(self, body: WaypointsIn) -> JSONResponse:
        """Add waypoints to the mission."""
        try:
            navigation = body.navigation()
        except InvalidWaypointError as error:
            raise HTTPException(422, str(error)) from None
        ids = ", ".join(waypoint.id for waypoint in body.waypoints)
        return await self._tell(f"add {ids}", self._mission.fly(navigation, body.index))

    def route(self, name: str, command: Command) -> Callable[[], Any]:
        """Make the handler of one command."""

        async def tell() -> JSONResponse:
            return await self._tell(name, self._mission.command(command))

        return tell

    async def stream(
        self,
        socket: WebSocket,
        rate: Annotated[float, Query(gt=0, le=20, allow_inf_nan=False)] = 5.0,
    ) -> None:
        """Send the status `rate` times a second until the mission is over."""
        await socket.accept()
        try:
            while True:
                # Read once: a mission that ends while this one is being sent is told so next.
                status = self._mission.status()
                if status is not None:
                    shown = StatusOut.of(status, self._mission.vehicle())
                    await socket.send_text(shown.model_dump_json())
                    if status.state in TERMINAL:
                        break
                await asyncio.sleep(1.0 / rate)
            await socket.close()
        except (WebSocketDisconnect, RuntimeError):
            return

    async def _tell(self, what: str, answer: Future[Answer]) -> JSONResponse:
        """Await the mission's answer and publish it as an alert."""
        try:
            said = await asyncio.wait_for(asyncio.wrap_future(answer), _PATIENCE)
        except asyncio.TimeoutError:
            text = f"the drone did not answer within {_PATIENCE:g} s"
            self._note(f"{what}: {text}")
            raise HTTPException(504, text) from None
        word = "accepted" if said.accepted else "refused"
        self._note(f"{what}: {word}{': ' if said.text else ''}{said.text}")
        content = AnswerOut.of(said).model_dump()
        return JSONResponse(content, 200 if said.accepted else 409)

    def _note(self, text: str) -> None:
        status = self._mission.status()
        header = Header(self._count, status.stamp if status else 0, "remote")
        self._count += 1
        self._mission.alert(Alert(header, "remote_command", f"a remote user asked to {text}"))


def _jpeg(frame: Frame) -> bytes:
    import cv2  # noqa: PLC0415 - only if an image is requested

    _, encoded = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, 80])
    return encoded.tobytes()


def _malformed(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)  # noqa: S101 - registered for it alone
    return _refusal(*malformed(error.errors()))


def _failed(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, AnyHTTPException)  # noqa: S101 - registered for it alone
    return _refusal(error.status_code, str(error.detail))


def _refusal(status: int, text: str) -> JSONResponse:
    return JSONResponse(AnswerOut(accepted=False, text=text).model_dump(), status)
