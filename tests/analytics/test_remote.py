"""The remote control over real HTTP and WebSocket, in front of a real mission."""

from __future__ import annotations

import http.client
import itertools
import json
import pickle
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

import pytest
from flights import Flight, add, flight, live
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from aerodaas.analytics.remote.analytics import RemoteAnalytics
from aerodaas.analytics.remote.client import TOKEN_VARIABLE, RemoteClient
from aerodaas.cli.app import app as cli
from aerodaas.config.model import EnvironmentConfig, LimitsConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import ConfigError, MissionError, SourceError
from aerodaas.http_server.addresses import is_loopback
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Answer, Command, StreamItem
from aerodaas.recording.provenance import Provenance

pytestmark = pytest.mark.wall_clock

TOKEN = "correct-horse-battery"  # noqa: S105 - this test's own
STREAM = "drone/remote"
RANGE = LimitsConfig(max_range=200.0)


@dataclass
class DirectLink:
    """Hands commands to a mission of this process; `deaf` never answers."""

    flown: Flight
    deaf: bool = False
    alerts: list[Alert] = field(default_factory=list)

    def status(self) -> MissionStatus:
        """The mission's word."""
        return self.flown.mission.status

    def vehicle(self) -> VehicleState:
        """The vehicle's state."""
        return self.flown.vehicle.read()

    def command(self, command: Command) -> Future[Answer]:
        """Answer at once."""
        future: Future[Answer] = Future()
        if not self.deaf:
            future.set_result(self.flown.tell(command))
        return future

    def fly(self, navigation: AeroNavigation, index: int | None = None) -> Future[Answer]:
        """Take navigation as an item of the stream."""
        return self.command(StreamItem(STREAM, navigation, index=index, replaces=False))

    def alert(self, alert: Alert) -> None:
        """Keep alerts."""
        self.alerts.append(alert)


@dataclass
class Service:
    """A service in front of a drone that is on its way to a waypoint 100 m east."""

    link: DirectLink
    port: int

    def client(self, token: str | None = TOKEN) -> RemoteClient:
        """A client of this service."""
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


def serving(token: str | None) -> Iterator[Service]:
    """A service with this token."""
    flown = flight(add(Waypoint("far", 100, 0, 2)), live(STREAM), limits=RANGE)
    flown.run_to(MissionState.ENROUTE)
    service = Service(DirectLink(flown), free_port())
    settings_of = {"remote": {"port": service.port, **({"token": token} if token else {})}}
    analysis = RemoteAnalytics(settings_of)
    analysis.open()
    analysis.begin(service.link)
    yield service
    analysis.close()


@pytest.fixture
def service() -> Iterator[Service]:
    """A service with a token."""
    yield from serving(TOKEN)


@pytest.fixture
def open_service() -> Iterator[Service]:
    """A service without a token, on loopback."""
    yield from serving(None)


def test_waypoints_are_queued_and_flown(service: Service) -> None:
    """What is added is visited; at an index, before the rest; and everybody hears of it."""
    look = [{"id": "look", "x": 3, "y": 0, "z": 2, "hover_duration": 1.0}]
    assert service.client().add_waypoints(look, index=0)["accepted"]
    assert service.client().add_waypoints([{"id": "last", "x": 100, "y": 5, "z": 2}])["accepted"]
    service.link.flown.run(until=lambda: len(service.link.status().visited) == 3)
    assert service.link.status().visited == ("look", "far", "last")
    assert "asked to add look: accepted" in service.link.alerts[0].text


def test_mission_obeys_and_says_so(service: Service) -> None:
    """Pause, resume, clear, return home and abort do what they say; nonsense is refused."""
    client, flown = service.client(), service.link.flown
    client.command("pause")
    flown.run(1.0)
    assert client.status()["state"] == "paused"
    client.command("resume")
    with pytest.raises(MissionError, match="not paused"):
        client.command("resume")
    client.command("clear")
    flown.run(1.0)
    status = client.status()
    assert (status["state"], status["pending"], status["target"]) == ("holding", [], None)
    client.command("return-home")
    flown.run(0.2)
    assert client.status()["reason"] == "a remote user asked to return"
    client.command("abort")
    flown.run()
    assert client.status()["state"] == "landed"
    with pytest.raises(MissionError, match="the mission is over"):
        client.command("pause")


@pytest.mark.parametrize(
    ("waypoint", "reason"),
    [
        ({"id": "far", "x": 1, "y": 1, "z": 2}, "already queued"),
        ({"id": "a", "x": 900, "y": 0, "z": 2}, "beyond the range"),
        ({"id": "a", "x": 1, "y": 1, "z": -1}, "floor"),
        ({"id": "a", "x": 1, "y": 1, "z": 2, "deadline": 0.5}, "is past"),
        ({"id": "a", "x": 1, "y": 1, "z": 2, "waypoint_type": "global"}, "no home"),
    ],
)
def test_mission_refuses_with_its_reason(
    service: Service, waypoint: dict[str, Any], reason: str
) -> None:
    """409, and the reason of each waypoint; the flight goes on."""
    body = json.dumps({"waypoints": [waypoint]}).encode()
    status, answer = service.post("/waypoints", body)
    assert status == 409
    assert not answer["accepted"]
    assert reason in answer["refused"][waypoint["id"]]
    service.link.flown.run(1.0)
    assert service.link.status().state is MissionState.ENROUTE


def test_some_taken_and_some_refused(service: Service) -> None:
    """The good ones fly, the bad ones are named."""
    both = [{"id": "good", "x": 1, "y": 1, "z": 2}, {"id": "bad", "x": 900, "y": 0, "z": 2}]
    answer = service.client().add_waypoints(both)
    assert answer["accepted"]
    assert list(answer["refused"]) == ["bad"]


@pytest.mark.parametrize(
    ("body", "status", "place"),
    [
        (b"{", 400, "JSON"),
        (b"", 422, "body"),
        (b"[]", 422, "body"),
        (b'{"waypoints": []}', 422, "at least 1"),
        (b'{"waypoints": [{"id": "a", "x": NaN, "y": 0, "z": 1}]}', 422, "waypoints.0.x"),
        (b'{"waypoints": [{"id": "a", "x": 1e999, "y": 0, "z": 1}]}', 422, "waypoints.0.x"),
        (b'{"waypoints": [{"id": "a", "x": "1", "y": 0, "z": 1}]}', 422, "waypoints.0.x"),
        (b'{"waypoints": [{"id": "a", "x": 1, "y": 0}]}', 422, "waypoints.0.z"),
        (b'{"waypoints": [{"id": "a", "x": 1, "y": 0, "z": 1, "w": 1}]}', 422, "waypoints.0.w"),
        (
            b'{"waypoints": [{"id": "a", "x": 1, "y": 0, "z": 1, "waypoint_type": "mars"}]}',
            422,
            "waypoint_type",
        ),
        (
            b'{"waypoints": [{"id": "a", "x": 999, "y": 0, "z": 1, "waypoint_type": "global"}]}',
            422,
            "no latitude",
        ),
        (
            b'{"waypoints": [{"id":"a","x":1,"y":0,"z":1}, {"id":"a","x":2,"y":0,"z":1}]}',
            422,
            "more than one waypoint is called a",
        ),
    ],
)
def test_malformed_bodies_are_named(service: Service, body: bytes, status: int, place: str) -> None:
    """A clear 4xx that names the place; the mission never hears of it."""
    before = service.link.status()
    said, answer = service.post("/waypoints", body)
    assert (said, answer["accepted"]) == (status, False)
    assert place in answer["text"]
    assert service.link.status() == before


@settings(max_examples=40)
@given(body=st.binary(max_size=200))
def test_any_bytes_are_answered(anybody: Service, body: bytes) -> None:
    """Whatever comes is answered with 4xx."""
    status, answer = anybody.post("/waypoints", body)
    assert 400 <= status < 500
    assert not answer["accepted"]


@pytest.fixture(scope="module")
def anybody() -> Iterator[Service]:
    """A service for many requests."""
    yield from serving(TOKEN)


@pytest.mark.parametrize("token", [None, "", "wrong", TOKEN[:-1], TOKEN + "x", "Bearer"])
def test_wrong_token_reaches_nothing(service: Service, token: str | None) -> None:
    """401 before the body is read, on every path and on the WebSocket."""
    client = service.client(token)
    for ask in (client.status, client.frame, lambda: client.command("abort")):
        with pytest.raises((ConfigError, SourceError), match="token"):
            ask()
    status, _ = service.post("/waypoints", b"{", Authorization=f"Bearer {token}")
    assert status == 401
    with pytest.raises(SourceError, match="refuses"):
        next(client.stream())
    assert service.link.status().state is MissionState.ENROUTE


def test_bodies_have_a_size(service: Service) -> None:
    """Nobody fills the drone's memory."""
    status, answer = service.post("/waypoints", b"", **{"Content-Length": "2000000"})
    assert (status, "at most" in answer["text"]) == (413, True)


def test_without_a_token_web_pages_are_refused(open_service: Service) -> None:
    """On loopback programs may command, while a page in the user's browser may not."""
    assert open_service.client(None).command("pause")["accepted"]
    for headers in ({"Origin": "https://example.org"}, {"Host": "evil.example:80"}):
        status, _ = open_service.post("/resume", b"", **headers)
        assert status == 403
    status, _ = open_service.post("/resume", b"", Host=f"localhost:{open_service.port}")
    assert status == 200


def test_stream_ends_with_the_mission(service: Service) -> None:
    """A follower sees the state change, and the stream closes after the landing."""
    seen: list[str] = []

    def follow() -> None:
        seen.extend(status["state"] for status in service.client().stream(rate=20))

    follower = threading.Thread(target=follow)
    follower.start()
    while not seen:
        follower.join(0.05)
    service.client().command("abort")
    service.link.flown.run()
    follower.join(10)
    assert (seen[0], seen[-1]) == ("enroute", "landed")
    with pytest.raises(SourceError, match="refuses"):
        next(service.client().stream(rate=1000))


def test_a_mission_that_ends_while_its_status_is_sent_is_told_to_have_ended(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last status of a stream is the last one of the mission, whenever that ends."""
    flying = service.link.status()
    service.client().command("abort")
    service.link.flown.run()
    statuses = itertools.chain([flying], itertools.repeat(service.link.status()))
    monkeypatch.setattr(service.link, "status", lambda: next(statuses))
    seen = [status["state"] for status in service.client().stream(rate=20)]
    assert seen == ["enroute", "landed"]


def test_silent_drone_is_no_silent_answer(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the drone does not answer, the user is told so."""
    monkeypatch.setattr("aerodaas.analytics.remote.app._PATIENCE", 0.2)
    service.link.deaf = True
    with pytest.raises(MissionError, match="did not answer"):
        service.client().command("pause")


def test_address_and_token_are_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond loopback only with a token, which is long and is told to nobody."""
    with pytest.raises(ConfigError, match=TOKEN_VARIABLE):
        RemoteAnalytics({"remote": {"host": "0.0.0.0"}})  # noqa: S104 - refused
    with pytest.raises(ConfigError, match="token") as refused:
        RemoteAnalytics({"remote": {"token": "tiny-secret"}})
    assert "tiny-secret" not in str(refused.value)
    monkeypatch.setenv(TOKEN_VARIABLE, TOKEN)
    RemoteAnalytics({"remote": {"host": "0.0.0.0"}})  # noqa: S104 - with a token
    busy = socket.create_server(("127.0.0.1", 0))
    with busy, pytest.raises(SourceError, match=r"remote\.port"):
        RemoteAnalytics(port=busy.getsockname()[1]).open()
    assert is_loopback("::1")
    assert not is_loopback("example.org")


def test_token_is_recorded_nowhere() -> None:
    """The configuration that goes into the recording shows stars."""
    content = {"robots": [{"id": "drone"}], "remote": {"token": TOKEN}}
    config = EnvironmentConfig.model_validate(content)
    assert TOKEN not in Provenance.collect(config=config).config
    assert TOKEN not in repr(config)
    data = config.model_dump(by_alias=True)
    assert TOKEN not in str(data)
    sent = pickle.loads(pickle.dumps(RemoteAnalytics(data)))  # noqa: S301 - just made
    assert sent._settings.token.get_secret_value() == TOKEN


def test_command_line_speaks_it(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    """`aerodaas remote` adds waypoints, pauses and tells the state."""
    monkeypatch.setenv(TOKEN_VARIABLE, TOKEN)
    monkeypatch.setenv("AERODAAS_REMOTE_URL", f"http://127.0.0.1:{service.port}")
    run = CliRunner().invoke
    added = run(cli, ["remote", "add-waypoint", "5", "-5", "2", "--id", "tree", "--index", "0"])
    assert added.output == "tree is on the plan\n"
    assert service.link.status().pending[0].id == "tree"
    assert service.link.status().pending[0].y == -5.0
    for command in ("pause", "resume", "clear"):
        assert run(cli, ["remote", command]).exit_code == 0
    service.link.flown.run(1.0)
    assert "holding" in run(cli, ["remote", "status"]).output
    for command in ("return-home", "abort"):
        assert run(cli, ["remote", command]).exit_code == 0
    service.link.flown.run()
    lines = run(cli, ["remote", "status", "--follow", "--json"]).output.splitlines()
    assert json.loads(lines[-1])["state"] == "landed"
    monkeypatch.setenv(TOKEN_VARIABLE, "something else")
    refused = run(cli, ["remote", "pause"])
    assert isinstance(refused.exception, ConfigError)


def test_unreachable_service_is_explained() -> None:
    """The client says what to look at."""
    with pytest.raises(SourceError, match="is the mission flying"):
        RemoteClient(f"http://127.0.0.1:{free_port()}").status()
    with pytest.raises(ConfigError, match="http://host:port"):
        RemoteClient("127.0.0.1:8350")
