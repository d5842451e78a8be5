"""A service for the client's own tests: it answers by the wire's models, and fails as it is told."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import uvicorn
from fastapi import FastAPI, Request, Response, WebSocket
from fastapi.responses import JSONResponse
from starlette.websockets import WebSocketDisconnect
from typing_extensions import Self

from aerodaas.analytics.remote.schemas import AnswerOut, StatusOut
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


def status(**changes: Any) -> StatusOut:  # noqa: ANN401
    """A drone on its way."""
    known: dict[str, Any] = {
        "time": 3.0,
        "state": "enroute",
        "reason": "flying to a",
        "target": "a",
        "pending": [],
        "visited": [],
        "given_up": [],
        "waypoints_visited": 0,
        "waypoints_known": 1,
        "distance": 2.0,
        "faults": [],
        "position": [1.0, 0.0, 2.0],
        "velocity": [1.0, 0.0, 0.0],
        "yaw": 0.0,
        "battery": 0.9,
    }
    return StatusOut(**{**known, **changes})


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
    answer: AnswerOut = field(default_factory=lambda: AnswerOut(accepted=True))
    refusals: dict[str, tuple[int, Any]] = field(default_factory=dict)
    """Status and JSON by the beginning of a path, instead of an answer."""
    asked: list[tuple[str, str, Any]] = field(default_factory=list)
    """Method, path and content of each request."""
    models: set[str] = field(default_factory=set)
    cuts: int = 0
    """Live connections that end after one message."""
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
        return [content for one, path, content in self.asked if (one, path[-len(ending) :]) == (method, ending)]

    def _app(self) -> FastAPI:
        app = FastAPI()

        @app.middleware("http")
        async def refuse(request: Request, go_on: Any) -> Response:  # noqa: ANN401
            path = request.url.path
            body = await request.body()
            self.asked.append((request.method, path, body))
            if self.slow is not None:
                await asyncio.to_thread(self.slow.wait, 20)
            for start, (code, content) in self.refusals.items():
                if path.startswith(start):
                    if isinstance(content, bytes):
                        return Response(content, code)
                    return JSONResponse(content, code)
            if request.headers.get("authorization") != f"Bearer {TOKEN}":
                return JSONResponse({"text": "no valid token"}, 401)
            answer: Response = await go_on(request)
            return answer

        @app.get("/v1/fleet")
        def fleet() -> FleetOut:
            robots = [RobotOut(id="drone", sensors=["drone/odom"], battery=0.75)]
            return FleetOut(name="campus", robots=robots, environment=CATALOGUE)

        @app.head("/v1/models/{sha256}")
        def has(sha256: str) -> Response:
            return Response(status_code=204 if sha256 in self.models else 404)

        @app.put("/v1/models/{sha256}")
        def put(sha256: str) -> Response:
            self.models.add(sha256)
            return Response(status_code=204)

        @app.post("/v1/missions")
        def submit(wanted: MissionIn) -> MissionOut:
            assert wanted.document.navigation
            return mission(MissionPhase.SUBMITTED)

        @app.get("/v1/missions")
        def missions() -> list[MissionOut]:
            return [self.state]

        @app.get("/v1/missions/{id_}")
        def one(id_: str) -> MissionOut:  # noqa: ARG001
            return self.state

        @app.delete("/v1/missions/{id_}")
        def cancel(id_: str) -> MissionOut:  # noqa: ARG001
            self.on_cancel()
            return self.state

        @app.post("/v1/missions/{id_}/commands")
        def command(id_: str, body: CommandIn) -> AnswerOut:  # noqa: ARG001
            return self.answer

        @app.post("/v1/missions/{id_}/navigation")
        def navigation(id_: str, body: dict[str, Any]) -> AnswerOut:  # noqa: ARG001
            return self.answer

        @app.get("/v1/missions/{id_}/recording")
        def recording(id_: str) -> Response:  # noqa: ARG001
            return Response(self.recording)

        @app.websocket("/v1/missions/{id_}/live")
        async def live(socket: WebSocket, id_: str, streams: str = "") -> None:  # noqa: ARG001
            if "/v1/missions" in self.refusals:
                await socket.close(1008)
                return
            await socket.accept()
            try:
                await self._live(socket, streams)
            except (WebSocketDisconnect, RuntimeError):
                return

        return app

    async def _live(self, socket: WebSocket, streams: str) -> None:
        for head, blob in self.items if streams else ():
            await socket.send_json({"kind": "item", "stream": streams, **head, "blob": bool(blob)})
            if blob:
                await socket.send_bytes(blob)
        while True:
            shown = self.state
            content = shown.model_dump(mode="json")
            await socket.send_json({"kind": "mission", "mission": content})
            if self.cuts:
                self.cuts -= 1
                await socket.close(1011)
                return
            if shown.phase.over:
                await socket.send_json({"kind": "end"})
                await socket.close()
                return
            await asyncio.sleep(0.05)
