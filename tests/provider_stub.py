"""A service for the client's own tests: answers by the wire's models, and fails as it is told."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import uvicorn
from fastapi import FastAPI, Request, Response, WebSocket
from fastapi.responses import JSONResponse
from robot_statuses import robot_status
from starlette.websockets import WebSocketDisconnect
from typing_extensions import Self

from aerodaas.messages.health import Verdict
from aerodaas.messages.mission import RobotStatus
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import (
    CommandIn,
    FleetOut,
    MissionIn,
    MissionOut,
    MissionPhase,
    RobotOut,
)

TOKEN = "t0k3n"  # noqa: S105 - of these tests alone
MISSION = "3f1a6c0d9b2e"
CATALOGUE: dict[str, Any] = {
    "name": "campus",
    "robots": [
        {
            "id": "drone",
            "sensors": [{"id": "odom", "type": "odometry", "rate": 10}],
            "limits": {"geofence": {"polygon": [[-50, -50], [50, -50], [50, 50], [-50, 50]]}},
        }
    ],
    "compute": [{"id": "edge", "kind": "edge"}],
}


def status(**changes: Any) -> RobotStatus:  # noqa: ANN401
    """A drone on its way."""
    known: dict[str, Any] = {
        "reason": "flying to a",
        "target": Waypoint("a", 5, 0, 2),
        "waypoint_counts": (0, 1),
        "distance": 2.0,
        "position": (1.0, 0.0, 2.0),
    }
    return robot_status(**{**known, **changes})


def mission(phase: MissionPhase = MissionPhase.FLYING, **changes: Any) -> MissionOut:  # noqa: ANN401
    """The one mission."""
    known: dict[str, Any] = {
        "id": MISSION,
        "name": "app",
        "tenant": "farmers",
        "account": "ann",
        "phase": phase,
        "robots": ["drone"],
        "submitted": 1.0,
        "status": {"drone": status()} if phase is MissionPhase.FLYING else {},
    }
    return MissionOut(**{**known, **changes})


@dataclass
class Stub:
    """One mission at a service on a loopback port; `phase` and `items` are its state."""

    state: MissionOut = field(default_factory=mission)
    recording: bytes = b"recorded"
    items: list[tuple[dict[str, Any], bytes]] = field(default_factory=list)
    answer: Answer = field(default_factory=lambda: Answer(accepted=True))
    refusals: dict[str, tuple[int, Any]] = field(default_factory=dict)
    """Status and JSON by the beginning of a path, instead of an answer."""
    asked: list[tuple[str, str, Any]] = field(default_factory=list)
    """Method, path and content of each request."""
    keys: list[str | None] = field(default_factory=list)
    """Idempotency key of each submission."""
    models: set[str] = field(default_factory=set)
    cuts: int = 0
    """Live connections that end after one message."""
    denied: int = 0
    """Live connections that were refused."""
    on_cancel: Callable[[], None] = lambda: None
    slow: threading.Event | None = None
    """What each answer waits for."""

    def __enter__(self) -> Self:
        """Listen."""
        listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        config = uvicorn.Config(self._app(), log_config=None, timeout_graceful_shutdown=1)
        self._server = uvicorn.Server(config)
        arguments = {"sockets": [listener]}
        self._thread = threading.Thread(target=self._server.run, kwargs=arguments, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        if self.slow is not None:
            self.slow.set()
        self._server.should_exit = True
        self._thread.join(10)

    def sent(self, method: str, ending: str) -> list[Any]:
        """Contents of the requests of this kind."""
        return [
            content
            for one, path, content in self.asked
            if (one, path[-len(ending) :]) == (method, ending)
        ]

    def _app(self) -> FastAPI:
        app = FastAPI()
        app.middleware("http")(self._admit)
        for method, path, answer in (
            ("GET", "/fleet", self._fleet),
            ("HEAD", "/models/{sha256}", self._has_model),
            ("PUT", "/models/{sha256}", self._put_model),
            ("POST", "/missions", self._submit),
            ("GET", "/missions", self._missions),
            ("GET", "/missions/{mission}", self._mission),
            ("DELETE", "/missions/{mission}", self._cancel),
            ("POST", "/missions/{mission}/approve", self._mission),
            ("POST", "/missions/{mission}/commands", self._command),
            ("POST", "/missions/{mission}/navigation", self._navigation),
            ("GET", "/missions/{mission}/recording", self._recording),
            ("DELETE", "/missions/{mission}/recording", self._delete_recording),
        ):
            app.add_api_route(f"/v1{path}", answer, methods=[method])
        app.add_api_websocket_route("/v1/missions/{mission}/live", self._follow)
        return app

    async def _admit(self, request: Request, go_on: Any) -> Response:  # noqa: ANN401
        path = request.url.path
        self.asked.append((request.method, path, await request.body()))
        if (request.method, path) == ("POST", "/v1/missions"):
            self.keys.append(request.headers.get("idempotency-key"))
        if self.slow is not None:
            await asyncio.to_thread(self.slow.wait, 20)
        for start, (code, content) in self.refusals.items():
            if path.startswith(start):
                raw = isinstance(content, bytes)
                return Response(content, code) if raw else JSONResponse(content, code)
        if request.headers.get("authorization") != f"Bearer {TOKEN}":
            return JSONResponse({"text": "no valid token"}, 401)
        answer: Response = await go_on(request)
        return answer

    def _fleet(self) -> FleetOut:
        robots = [
            RobotOut(id="drone", sensors=["drone/odom"], battery=0.75, preflight=Verdict.REFUSED)
        ]
        return FleetOut(name="campus", robots=robots, environment=CATALOGUE)

    def _has_model(self, sha256: str) -> Response:
        return Response(status_code=204 if sha256 in self.models else 404)

    def _put_model(self, sha256: str) -> Response:
        self.models.add(sha256)
        return Response(status_code=204)

    def _submit(self, wanted: MissionIn) -> MissionOut:
        assert wanted.document.navigation
        return mission(MissionPhase.SUBMITTED)

    def _missions(self) -> list[MissionOut]:
        return [self.state]

    def _mission(self) -> MissionOut:
        return self.state

    def _cancel(self) -> MissionOut:
        self.on_cancel()
        return self.state

    def _command(self, body: CommandIn) -> Answer:  # noqa: ARG002 - checked by its model
        return self.answer

    def _navigation(self, body: dict[str, Any]) -> Answer:  # noqa: ARG002 - as above
        return self.answer

    def _recording(self) -> Response:
        return Response(self.recording)

    def _delete_recording(self) -> Response:
        return Response(status_code=204)

    async def _follow(self, socket: WebSocket, streams: str = "") -> None:
        if "/v1/missions" in self.refusals:
            code, content = self.refusals["/v1/missions"]
            self.denied += 1
            await socket.send_denial_response(JSONResponse(content, code))
            return
        await socket.accept()
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await self._live(socket, streams)

    async def _live(self, socket: WebSocket, streams: str) -> None:
        for head, blob in self.items if streams else ():
            await socket.send_json({"kind": "item", "stream": streams, **head, "blob": bool(blob)})
            if blob:
                await socket.send_bytes(blob)
        while True:
            shown = self.state
            content = shown.model_dump_json()
            await socket.send_text(f'{{"kind": "mission", "mission": {content}}}')
            if self.cuts:
                self.cuts -= 1
                await socket.close(1011)
                return
            if shown.phase.over:
                await socket.send_json({"kind": "end"})
                await socket.close()
                return
            await asyncio.sleep(0.05)
