"""A console without a flight behind it: of a drone that is always on its way to one waypoint."""

from __future__ import annotations

import json
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np

from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.graph import Graph
from aerodaas.errors import MissionError
from aerodaas.messages.health import HealthReport
from aerodaas.messages.mission import BatteryOutlook, MissionState, MissionStatus, RobotStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import Traffic, VehicleMode, VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Answer, Command
from aerodaas.service.own.flight import OwnFlight
from aerodaas.service.own.server import FlightServer

__all__ = ["Run", "ask", "console", "token_of", "watched_console"]

ENVIRONMENT = {
    "name": "field",
    "robots": [{"id": "drone", "driver": "simulated"}],
    "compute": [{"id": "edge", "kind": "edge"}],
}


class Run:
    """A flight that hovers before one waypoint, and remembers what it was told."""

    def __init__(self, **environment: object) -> None:
        self.config = EnvironmentConfig.model_validate({**ENVIRONMENT, **environment})
        self.graph = Graph()
        self.over = False
        self.state: Any = None
        self.commands: list[Command] = []
        self.notes: list[str] = []
        self.alerts: list[Alert] = []
        self.health = HealthReport()
        self.traffic: tuple[Traffic, ...] = ()
        self.time = 1.0
        """Mission seconds."""
        self.mission_state = MissionState.ENROUTE

    def poll(self, newest: int = 200) -> Any:  # noqa: ANN401 - a FlightState's shape
        """Enroute to a waypoint."""
        del newest
        target = Waypoint("wp1", 3, 4, 2, waypoint_type="local")
        still = np.zeros(3)
        odometry = Odometry(np.array([1.0, 2.0, 3.0]), still, 0.0)
        fix = GpsFix(50.0, 8.0, 120.0, horizontal_sigma=1.24, satellites=14)
        vehicle = VehicleState(
            1,
            odometry,
            Battery(0.5),
            VehicleMode.GUIDED,
            armed=True,
            gps=fix,
            traffic=self.traffic,
        )
        outlook = BatteryOutlook(plan=0.61, returns_at=0.27, hover=207.0)
        status = MissionStatus(
            round(self.time * 10**9), self.mission_state, "flying to wp1", target, outlook=outlook
        )
        robots = {"drone": RobotStatus(status, vehicle, self.health)}
        return SimpleNamespace(robots=robots, alerts=list(self.alerts), reports={})

    def command(self, robot: str, command: Command) -> Answer:
        """Remember it."""
        if robot != "drone":
            raise MissionError(f"{robot} does not fly")
        self.commands.append(command)
        return Answer(accepted=True, text="so be it")

    def publish_alert(self, kind: str, text: str) -> None:
        """Remember it."""
        self.notes.append(f"{kind}: {text}")


@contextmanager
def console(*, framed: bool = False, **environment: object) -> Iterator[tuple[FlightServer, Run]]:
    """The console of a flight that never ends, in an environment with further fields."""
    run = Run(**environment)
    server = FlightServer("127.0.0.1:0", "--console-address")
    server.framed = framed
    flight = OwnFlight(run, "survey")
    server.show(flight)
    try:
        yield server, run
    finally:
        flight.close()
        server.close()


def token_of(address: str) -> str:
    """The token in an address."""
    return address.partition("#token=")[2]


def ask(
    address: str, path: str, body: object = None, token: str | None = None, **headers: str
) -> tuple[int, dict[str, str], Any]:
    """Send a request; returns status, headers and the answer."""
    data = None if body is None else json.dumps(body).encode()
    more = {"Authorization": f"Bearer {token_of(address) if token is None else token}"}
    request = urllib.request.Request(  # noqa: S310 - loopback
        address.partition("/#")[0] + path,
        data,
        {**more, "Content-Type": "application/json", **headers},
    )
    try:
        with urllib.request.urlopen(request, timeout=20) as response:  # noqa: S310 - loopback
            status, known, content = response.status, response.headers, response.read()
    except urllib.error.HTTPError as error:
        status, known, content = error.code, error.headers, error.read()
    found = json.loads(content) if known.get_content_type() == "application/json" else content
    return status, {key.lower(): value for key, value in known.items()}, found


@contextmanager
def watched_console(**environment: Any) -> Iterator[tuple[FlightServer, Run]]:  # noqa: ANN401 - any of its fields
    """The console of `console`, whose drone's status is known."""
    with console(**environment) as (server, run):
        while not ask(server.address(), "/v1/missions/own")[2]["status"]:
            time.sleep(0.05)
        yield server, run
