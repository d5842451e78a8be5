"""Requests of a remote user to the API of a flight, which commands a flying mission.

An input is a text of requests, one a line: a path below the mission's, a space and a body.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.graph import Graph
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.messages.mission import MissionState, RobotStatus
from aerodaas.mission.commands import Answer, Command
from aerodaas.protocol.schemas import COMMANDS, Role
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.limits import OWN_FLIGHT
from aerodaas.service.own.access import FlightTokens, principal_of
from aerodaas.service.own.flight import OwnFlight
from aerodaas.service.own.server import flight_app
from tools.fuzz.flight import LIMITS, TURN, FuzzedFlight, require

__all__ = ["run", "seeds"]

_ENVIRONMENT = EnvironmentConfig.model_validate(
    {
        # In the fence's corner; nearer, the estimate's noise is beyond it, and nothing takes off.
        "robots": [{"id": "drone", "limits": LIMITS, "start": (7.9, 7.9, 0.0)}],
        "simulation": {"world": "empty"},
    }
)
_MISSION = b"/v1/missions/own"
_REQUESTS = 8
"""Most requests of one input that are made."""
_BETWEEN, _TURNS = 3, 12
"""Turns of the setpoint loop between two requests, and after the last one."""
_CLIMB = 120
"""Most turns until the drone is on its way."""
_SERVERS_FAULT = 500


def seeds() -> Iterable[bytes]:
    """Each kind of request, alone and after another."""
    place = {"id": "a", "x": 3, "y": -2.5, "z": 2, "hover_duration": 1, "yaw": 0.5, "speed": 1}
    far = {
        "id": "b",
        "x": 1,
        "y": 1,
        "z": 3,
        "priority": 2,
        "deadline": 100,
        "waypoint_type": "local",
    }
    body = json.dumps({"robot": "drone", "waypoints": [place, far], "index": 1, "ordered": True})
    alone = json.dumps({"robot": "drone", "waypoints": [place]})
    given = {word: json.dumps({"robot": "drone", "command": word}) for word in COMMANDS}
    yield f"/navigation {body}\n/commands {given['pause']}\n/commands {given['resume']}".encode()
    yield f"/commands {given['clear']}\n/navigation {alone}\n".encode()
    yield f"/commands {given['return-home']}\n/commands {given['land']}\n/scenery ".encode()
    yield b'/plan {"robot": "drone", "order": [], "remove": ["a"]}\n/nothing {}'
    yield b'/actuators {"robot": "drone", "actuator": "grip", "position": "open"}'


def run(data: bytes) -> None:
    """Make the requests; the loop flies on, and what it sends stays within its limits."""
    link, app, loop = _service()
    link.begin()
    link.flight.by_hand = bool(len(data) % 2)
    for line in data.split(b"\n")[:_REQUESTS]:
        path, _, body = line.partition(b" ")
        method = "GET" if path in {b"", b"/scenery"} else "POST"
        code, answer = loop.run_until_complete(_ask(app, method, _MISSION + path, body))
        require(code < _SERVERS_FAULT, f"an answer of code {code}")
        if method == "POST":
            require("accepted" in answer or "text" in answer, "an answer that says nothing")
        link.turn(_BETWEEN)
    link.turn(_TURNS - _BETWEEN)
    kinds = {alert.kind for alert in link.flight.mission.alerts}
    require(not kinds & {"motors_stopped", "geofence", "turn_failed"}, f"alerts {kinds}")


class _Link:
    """A run whose one mission is this process'; see `Flown`."""

    config = _ENVIRONMENT
    graph = Graph()
    state: Any = None
    over = False
    drone: SimulatedVehicle
    flight: FuzzedFlight
    _now = 0

    def begin(self) -> None:
        """Command a new mission, that of a drone on its way.

        A copy of the first one, which takes a tenth of the time of a climb.
        """
        self._now, self.drone, self.flight = deepcopy(_on_its_way())

    def turn(self, times: int) -> int:
        """Fly on; the clock's nanoseconds afterwards."""
        for _ in range(times):
            self._now += round(TURN * 1e9)
            self.drone.advance_to(self._now)
            self.flight.turn()
        return self._now

    def poll(self, newest: int = 200) -> Any:  # noqa: ANN401 - a FlightState's shape
        del newest
        status, vehicle = self.flight.mission.status, self.drone.read()
        drone = RobotStatus(status, vehicle)
        return SimpleNamespace(robots={"drone": drone}, alerts=[], reports={})

    def command(self, robot: str, command: Command) -> Answer:
        del robot
        return self.flight.mission.handle(command, self._now)

    def publish_alert(self, kind: str, text: str) -> None:
        require(f"{kind}{text}".isprintable(), "an alert that cannot be printed")


@cache
def _on_its_way() -> tuple[int, SimulatedVehicle, FuzzedFlight]:
    """Nanoseconds of the clock, a vehicle and its mission, once it is on its way."""
    link = _Link()
    robot = _ENVIRONMENT.robots[0]
    link.drone = SimulatedVehicle(robot, _ENVIRONMENT)
    link.drone.connect()
    link.flight = FuzzedFlight(link.drone, robot)
    now = 0
    while link.flight.state is not MissionState.ENROUTE:
        require(now < _CLIMB * TURN * 1e9, "a flight that never begins")
        now = link.turn(1)
    return now, link.drone, link.flight


@cache
def _service() -> tuple[_Link, Any, asyncio.AbstractEventLoop]:
    """The service of all inputs, which keeps nothing of a mission: making it takes longer than one.

    An event loop that an input has left broken would show in all later ones.
    """
    link = _Link()
    tokens = FlightTokens({}, anybody=principal_of("remote", Role.PILOT))
    limits = replace(OWN_FLIGHT, rate=1e9, burst=1e9)
    app = flight_app(OwnFlight(link, "fuzzed"), Admission(tokens), limits=limits)
    return link, app, asyncio.new_event_loop()


async def _ask(app: Any, method: str, path: bytes, body: bytes) -> tuple[int, dict[str, Any]]:  # noqa: ANN401
    """One request without a network: the status of the answer, and its JSON."""
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": body, "more_body": False}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method,
        "path": path.decode("latin-1"),
        "raw_path": path,
        "root_path": "",
        "scheme": "http",
        "query_string": b"",
        "headers": [(b"content-type", b"application/json")],
    }
    await app(scope, receive, send)
    content = b"".join(message.get("body", b"") for message in sent)
    answer = json.loads(content) if method == "POST" else {}
    return sent[0]["status"], answer
