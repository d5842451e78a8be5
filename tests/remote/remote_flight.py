"""A flight of this process behind the API of its remote user."""

from __future__ import annotations

import http.client
import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import pytest
from flights import Flight, add, flight, live

from aerodaas.analytics.remote import RemoteAnalytics
from aerodaas.config.model import EnvironmentConfig, LimitsConfig, RemoteConfig
from aerodaas.dataflow.graph import Graph
from aerodaas.environment.remote_client import RemoteClient
from aerodaas.errors import MissionError
from aerodaas.messages.mission import MissionState, RobotStatus
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Answer, Command
from aerodaas.service.own import flight as own_flight
from aerodaas.service.own.flight import OwnFlight
from aerodaas.service.own.server import FlightServer

TOKEN = "correct-horse-battery"  # noqa: S105 - the tests' own
STREAM = "drone/remote"
NAVIGATION = "/v1/missions/own/navigation"


def graph_with_a_remote_user() -> Graph:
    """One remote user, by a stream that the application has added."""
    navigation = SimpleNamespace(stream=SimpleNamespace(name=STREAM))
    edge = SimpleNamespace(robot="drone", navigation=navigation)
    nodes = {STREAM: SimpleNamespace(work=object.__new__(RemoteAnalytics))}
    return cast("Graph", SimpleNamespace(nodes=nodes, navigation=[edge], reader=None))


@dataclass
class DirectRun:
    """A run whose one mission is this process'."""

    flown: Flight
    config: EnvironmentConfig = field(
        default_factory=lambda: EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
    )
    graph: Graph = field(default_factory=graph_with_a_remote_user)
    state: Any = None
    notes: list[str] = field(default_factory=list)
    over: bool = False

    def poll(self, newest: int = 200) -> Any:  # noqa: ANN401 - a FlightState's shape
        """The mission's word."""
        del newest
        vehicle = self.flown.vehicle.read()
        drone = RobotStatus(self.flown.status, vehicle)
        self.state = SimpleNamespace(robots={"drone": drone}, alerts=[], reports={})
        return self.state

    def command(self, robot: str, command: Command) -> Answer:
        """Answer at once."""
        if robot != "drone":
            raise MissionError(f"{robot} does not fly")
        return self.flown.tell(command)

    def publish_alert(self, kind: str, text: str) -> None:
        """Keep alerts."""
        self.notes.append(f"{kind}: {text}")


def on_its_way(limits: LimitsConfig, east: float) -> DirectRun:
    """A drone on its way to a waypoint so many metres east."""
    flown = flight(add(Waypoint("far", east, 0, 2)), live(STREAM), limits=limits)
    flown.run_to(MissionState.ENROUTE)
    return DirectRun(flown)


@dataclass
class Served:
    """The API in front of a drone that is on its way."""

    run: DirectRun
    flight: OwnFlight
    port: int

    @property
    def flown(self) -> Flight:
        """The drone's mission."""
        return self.run.flown

    def client(self, token: str | None = TOKEN) -> RemoteClient:
        """A client of this flight."""
        return RemoteClient(f"http://127.0.0.1:{self.port}", token)

    def post(self, path: str, body: bytes, **headers: str) -> tuple[int, dict[str, Any]]:
        """Post anything at all; returns status and JSON."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        authorised = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
        connection.request("POST", path, body, authorised | headers)
        response = connection.getresponse()
        content = json.loads(response.read())
        connection.close()
        return response.status, content


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@contextmanager
def served(token: str | None = TOKEN) -> Iterator[Served]:
    """The API of a flight, with this token."""
    run, port = on_its_way(LimitsConfig(max_range=200.0), 100.0), free_port()
    settings = RemoteConfig.model_validate({"port": port, **({"token": token} if token else {})})
    server = FlightServer.of_remote(settings)
    own = OwnFlight(run, "survey")
    server.show(own)
    yield Served(run, own, port)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(own_flight, "_FAREWELL", 0.0)
        own.close()
    server.close()
