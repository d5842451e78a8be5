"""A remote user of a flight, over real HTTP and WebSocket, in front of a real mission."""

from __future__ import annotations

import json
import pickle
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
import remote_flight
from hypothesis import given, settings
from hypothesis import strategies as st
from remote_flight import NAVIGATION, TOKEN, Served, free_port, served
from typer.testing import CliRunner

from aerodaas.analytics.remote import TOKEN_VARIABLE, RemoteAnalytics
from aerodaas.cli.app import app as cli
from aerodaas.config.model import EnvironmentConfig, RemoteConfig
from aerodaas.environment.remote_client import RemoteClient
from aerodaas.errors import AeroDaaSError, ConfigError, MissionError, SilentError, SourceError
from aerodaas.http_server.addresses import is_loopback
from aerodaas.messages.mission import MissionState
from aerodaas.mission.commands import Answer, Command, Pause, Resume
from aerodaas.protocol.schemas import CommandIn, Role
from aerodaas.recording.provenance import Provenance
from aerodaas.service.own import flight as own_flight
from aerodaas.service.own.access import OWN, REMOTE, principal_of
from aerodaas.service.own.server import FlightServer

pytestmark = pytest.mark.wall_clock

COMMANDS = "/v1/missions/own/commands"
PAUSE = json.dumps({"robot": "drone", "command": "pause"}).encode()


@pytest.fixture
def service() -> Iterator[Served]:
    """The API with a token."""
    with served() as one:
        yield one


@pytest.fixture(scope="module")
def anybody() -> Iterator[Served]:
    """The API for many requests."""
    with served() as one:
        yield one


@pytest.fixture
def open_service() -> Iterator[Served]:
    """The API without a token, on loopback."""
    with served(None) as one:
        yield one


def navigation(waypoint: object) -> bytes:
    """A request to fly to a waypoint."""
    return json.dumps({"robot": "drone", "waypoints": [waypoint]}).encode()


def test_waypoints_are_queued_and_flown(service: Served) -> None:
    """What is added is visited; at an index, before the rest; and everybody hears of it."""
    look = [{"id": "look", "x": 3, "y": 0, "z": 2, "hover_duration": 1.0}]
    assert service.client().add_waypoints(look, index=0)["accepted"]
    assert service.client().add_waypoints([{"id": "last", "x": 100, "y": 5, "z": 2}])["accepted"]
    service.flown.run(until=lambda: len(service.flown.status.visited) == 3)
    assert service.flown.status.visited == ("look", "far", "last")
    assert service.run.notes[0] == (
        "console_command: a remote user asked drone to visit look: accepted"
    )


def test_mission_obeys_and_says_so(service: Served) -> None:
    """Pause, resume, clear, return home and land do what they say; nonsense is refused."""
    client, flown = service.client(), service.flown
    client.command("pause")
    flown.run(1.0)
    time.sleep(0.2)
    assert client.status().mission.state == "paused"
    client.command("resume")
    with pytest.raises(MissionError, match="not paused"):
        client.command("resume")
    client.command("clear")
    flown.run(1.0)
    time.sleep(0.2)
    mission = client.status().mission
    assert (mission.state, mission.ahead) == ("holding", ())
    client.command("return-home")
    flown.run(0.2)
    time.sleep(0.2)
    assert client.status().mission.reason == "its user asked to return"
    client.command("land")
    flown.run()
    time.sleep(0.2)
    assert client.status().mission.state == "landed"
    with pytest.raises(MissionError, match="the mission is over"):
        client.command("pause")
    with pytest.raises(ConfigError, match="command"):
        client.command("loop")


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
    anybody: Served, waypoint: dict[str, Any], reason: str
) -> None:
    """The reason of each waypoint; the flight goes on."""
    status, answer = anybody.post(NAVIGATION, navigation(waypoint))
    assert (status, answer["accepted"]) == (200, False)
    assert reason in answer["refused"][waypoint["id"]]
    with pytest.raises(MissionError, match=reason):
        anybody.client().add_waypoints([waypoint])
    assert anybody.flown.status.state is MissionState.ENROUTE


def test_some_taken_and_some_refused(service: Served) -> None:
    """The good ones fly, the bad ones are named."""
    both = [{"id": "good", "x": 1, "y": 1, "z": 2}, {"id": "bad", "x": 900, "y": 0, "z": 2}]
    answer = service.client().add_waypoints(both)
    assert answer["accepted"]
    assert list(answer["refused"]) == ["bad"]


@pytest.mark.parametrize(
    ("waypoints", "place"),
    [
        ("[]", "at least 1"),
        ('[{"id": "a", "x": NaN, "y": 0, "z": 1}]', "waypoints.0.x"),
        ('[{"id": "a", "x": 1e999, "y": 0, "z": 1}]', "waypoints.0.x"),
        ('[{"id": "a", "x": "1", "y": 0, "z": 1}]', "waypoints.0.x"),
        ('[{"id": "a", "x": 1, "y": 0}]', "waypoints.0.z"),
        ('[{"id": "a", "x": 1, "y": 0, "z": 1, "w": 1}]', "waypoints.0.w"),
        ('[{"id":"a","x":1,"y":0,"z":1,"waypoint_type":"moon"}]', "waypoint_type"),
        ('[{"id":"a","x":999,"y":0,"z":1,"waypoint_type":"global"}]', "no latitude"),
        (
            '[{"id":"a","x":1,"y":0,"z":1}, {"id":"a","x":2,"y":0,"z":1}]',
            "more than one waypoint is called a",
        ),
    ],
)
def test_malformed_waypoints_are_named(anybody: Served, waypoints: str, place: str) -> None:
    """422 that names the place; the mission never hears of it."""
    before = anybody.flown.status
    body = f'{{"robot": "drone", "waypoints": {waypoints}}}'
    status, answer = anybody.post(NAVIGATION, body.encode())
    assert status == 422
    assert place in answer["text"]
    assert anybody.flown.status == before


@settings(max_examples=40)
@given(body=st.binary(max_size=200))
def test_any_bytes_are_answered(anybody: Served, body: bytes) -> None:
    """Whatever comes is answered with 4xx."""
    status, answer = anybody.post(NAVIGATION, body)
    assert 400 <= status < 500
    assert answer["text"]


@pytest.mark.parametrize("token", [None, "", "wrong", TOKEN[:-1], TOKEN + "x", "Bearer"])
def test_wrong_token_reaches_nothing(service: Served, token: str | None) -> None:
    """401 before the body is read, on every path and on the WebSocket."""
    client = service.client(token)
    for ask in (client.status, client.frame, lambda: client.command("land")):
        with pytest.raises(AeroDaaSError, match="token"):
            ask()
    status, _ = service.post(NAVIGATION, b"{", Authorization=f"Bearer {token}")
    assert status == 401
    with pytest.raises(AeroDaaSError, match="token"):
        next(client.stream())
    assert service.flown.status.state is MissionState.ENROUTE


def test_many_wrong_tokens_are_slowed_and_the_right_one_is_not(service: Served) -> None:
    """People hear of it once."""
    codes = [service.post(COMMANDS, PAUSE, Authorization="Bearer no")[0] for _ in range(21)]
    assert codes == [401] * 10 + [429] * 11
    assert service.run.notes == ["wrong_tokens: remote control: 20 wrong tokens from 127.0.0.1"]
    assert service.client().command("pause")["accepted"]


def test_without_a_token_web_pages_are_refused(open_service: Served) -> None:
    """On loopback programs may command, while a page in the user's browser may not."""
    assert open_service.client(None).command("pause")["accepted"]
    here = f"http://127.0.0.1:{open_service.port}"
    foreign = (
        {"Origin": "https://example.org"},
        {"Origin": here, "Host": here.removeprefix("http://")},
        {"Host": "evil.example:80"},
    )
    for headers in foreign:
        assert open_service.post(COMMANDS, PAUSE, **headers)[0] == 403
    assert open_service.post(COMMANDS, PAUSE, Host=f"localhost:{open_service.port}")[0] == 200


def test_stream_ends_with_the_mission(service: Served) -> None:
    """A follower sees the state change, and the last status of the flight whatever its rate."""
    seen: list[str] = []

    def follow() -> None:
        seen.extend(status.mission.state for status in service.client().stream(rate=0.5))

    follower = threading.Thread(target=follow)
    follower.start()
    while not seen:
        follower.join(0.05)
    service.client().command("land")
    service.flown.run()
    service.run.poll()
    service.flight.close()
    follower.join(10)
    assert (seen[0], seen[-1]) == ("enroute", "landed")
    with pytest.raises(ConfigError, match="rate"):
        next(service.client().stream(rate=1000))


def test_silent_drone_is_no_silent_answer(service: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the drone does not answer, the user is told so, and people are."""
    monkeypatch.setattr(own_flight, "_PATIENCE", 0.1)
    monkeypatch.setattr(service.run, "command", lambda *_: time.sleep(0.5))
    assert service.post(COMMANDS, PAUSE)[0] == 504
    with pytest.raises(SourceError, match="did not answer"):
        service.client().command("pause")
    assert "did not answer" in service.run.notes[0]


def test_a_command_that_was_told_as_unanswered_is_not_given_later(
    service: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where others hang before it, it waits for its turn, and ends with its sender's patience."""
    begun, free = threading.Semaphore(0), threading.Event()
    carried_out: list[Command] = []

    def hang(_: str, command: Command) -> Answer:
        carried_out.append(command)
        begun.release()
        assert free.wait(20)
        return Answer(accepted=True)

    monkeypatch.setattr(own_flight, "_PATIENCE", 0.1)
    monkeypatch.setattr(service.run, "command", hang)
    pilot = principal_of(REMOTE, Role.PILOT)
    with ThreadPoolExecutor(40) as users:
        pauses = [CommandIn(robot="drone", command="pause")] * own_flight._MOST_ASKED
        asked = [users.submit(service.flight.fly, pilot, OWN, one) for one in pauses]
        for _ in asked:
            assert begun.acquire(timeout=20)
        with pytest.raises(SilentError):
            service.flight.fly(pilot, OWN, CommandIn(robot="drone", command="land"))
        free.set()
    monkeypatch.setattr(own_flight, "_PATIENCE", 5.0)
    assert service.flight.fly(pilot, OWN, CommandIn(robot="drone", command="resume")).accepted
    assert set(map(type, carried_out)) == {Pause, Resume}


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
    with busy, pytest.raises(ConfigError, match=r"remote\.port"):
        FlightServer.of_remote(RemoteConfig(port=busy.getsockname()[1]))
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
    assert sent.settings.token.get_secret_value() == TOKEN


def test_command_line_speaks_it(service: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """`aerodaas remote` adds waypoints, pauses and tells the state."""
    monkeypatch.setenv(TOKEN_VARIABLE, TOKEN)
    monkeypatch.setenv("AERODAAS_REMOTE_URL", f"http://127.0.0.1:{service.port}")
    run = CliRunner().invoke
    added = run(cli, ["remote", "add-waypoint", "5", "-5", "2", "--id", "tree", "--index", "0"])
    assert added.output == "tree is on the plan\n"
    assert service.flown.status.pending[0].id == "tree"
    assert service.flown.status.pending[0].y == -5.0
    for command in ("pause", "resume", "clear"):
        assert run(cli, ["remote", command]).exit_code == 0
    service.flown.run(1.0)
    time.sleep(0.2)
    assert "holding" in run(cli, ["remote", "status"]).output
    for command in ("return-home", "abort"):
        assert run(cli, ["remote", "--robot", "drone", command]).exit_code == 0
    service.flown.run()
    threading.Timer(1.0, service.flight.close).start()
    lines = run(cli, ["remote", "status", "--follow", "--json"]).output.splitlines()
    assert json.loads(lines[-1])["mission"]["state"] == "landed"
    monkeypatch.setenv(TOKEN_VARIABLE, "something else")
    refused = run(cli, ["remote", "pause"])
    assert isinstance(refused.exception, ConfigError)


def test_unreachable_flight_is_explained() -> None:
    """The client says what to look at."""
    with pytest.raises(SourceError, match="is the mission flying"):
        RemoteClient(f"http://127.0.0.1:{free_port()}").status()
    with pytest.raises(ConfigError, match="http://host:port"):
        RemoteClient("127.0.0.1:8350")


def test_waypoints_with_settings_of_their_own_are_no_items_of_the_stream(service: Served) -> None:
    """What a page asks with a deadline, or to clear first, is done as it asks."""
    near = {"id": "near", "x": 3, "y": 0, "z": 2}
    body = {"robot": "drone", "waypoints": [near], "clear_first": True}
    assert service.post(NAVIGATION, json.dumps(body).encode())[1]["accepted"]
    service.flown.run(0.2)
    target = service.flown.status.target
    assert target is not None
    assert target.id == "near"
    assert remote_flight.STREAM in service.run.graph.nodes
