"""Who may do what at the console of one's own flight, and what its answers are."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict
from typing import Any

import pytest
from hovering import Run, ask, console, token_of
from waiting import until
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from aerodaas.errors import ConfigError
from aerodaas.messages.health import HealthItem, HealthReport, Verdict
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, Pause
from aerodaas.service.http.gate import bearer
from aerodaas.service.own.server import FlightServer

pytestmark = pytest.mark.wall_clock

HOVER = {"robot": "drone", "command": "pause"}


@pytest.fixture(scope="module")
def flying() -> Iterator[tuple[FlightServer, Run]]:
    """One for all tests here."""
    with console() as both:
        yield both


def test_a_host_that_looks_like_the_page_opens_nothing() -> None:
    """An address put together from the `Host` header would end in the page's own path."""
    with console() as (server, _):
        address = server.address()
        host = address.removeprefix("http://").partition("/#")[0]
        for tail in ("/#", "/?", "/icon.svg?", "\\/#"):
            assert ask(address, "/v1/missions", token="", Host=host + tail)[0] in {400, 401}


@pytest.mark.parametrize("path", ["/", "/console.js", "/console.css", "/icon.svg"])
def test_the_page_needs_no_token_and_admits_nothing_from_elsewhere(
    flying: tuple[FlightServer, Run], path: str
) -> None:
    """It holds no secret, and runs no script but its own."""
    status, headers, content = ask(flying[0].address(), path, token="")
    assert status == 200
    assert content
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "img-src 'self' blob:; " in policy
    assert "script-src 'self';" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert headers["x-content-type-options"] == "nosniff"


def test_pictures_come_from_the_tiles_server_too_and_scripts_do_not() -> None:
    """Where an environment names one; what lies below the flight is told to whoever watches."""
    tiles = {"url": "https://tiles.example/{z}/{x}/{y}.png", "attribution": "© them"}
    home = {"latitude": 50.0, "longitude": 8.0}
    with console(map_tiles=tiles, home=home, simulation={"world": "campus"}) as (server, _):
        policy = ask(server.address(), "/", token="")[1]["content-security-policy"]
        assert "img-src 'self' blob: https://tiles.example; " in policy
        assert policy.count("tiles.example") == 1
        address = server.address(viewer=True)
        status, _, scenery = ask(address, "/v1/missions/own/scenery")
        assert status == 200
        assert scenery["tiles"] == {**tiles, **home, "max_zoom": 19, "archive": False}
        library = next(one for one in scenery["shapes"] if one["kind"] == "building")
        assert library["outline"][0] == [30.0, 22.0]
        assert ask(address, "/v1/missions/other/scenery")[0] == 404
        assert ask(f"{address}9", "/v1/missions/own/scenery")[0] == 401


def test_a_notebook_of_this_machine_may_frame_the_page() -> None:
    """Where it was asked for, and nobody from elsewhere."""
    with console(framed=True) as (server, _):
        policy = ask(server.address(), "/", token="")[1]["content-security-policy"]
    assert "frame-ancestors http://127.0.0.1:* http://localhost:*" in policy
    assert "default-src 'none'" in policy
    assert "img-src 'self' blob:; " in policy


@pytest.mark.parametrize("token", ["", "wrong", "é"])
def test_all_else_needs_one(flying: tuple[FlightServer, Run], token: str) -> None:
    """Neither state nor commands without one of the two tokens."""
    if not token.isascii():
        token = token.encode().decode("latin-1")
    for path, body in (("/v1/missions", None), ("/v1/missions/own/commands", HOVER)):
        status, _, answer = ask(flying[0].address(), path, body, token)
        assert status == 401
        assert "token" in answer["text"]
    assert not flying[1].commands


def test_a_viewer_watches_and_does_not_fly(flying: tuple[FlightServer, Run]) -> None:
    """The second token sees the state; whatever it asks of the drone is refused."""
    address = flying[0].address(viewer=True)
    assert ask(address, "/v1/me")[2]["role"] == "viewer"
    assert ask(address, "/v1/missions/own")[2]["name"] == "survey"
    visit = {"robot": "drone", "waypoints": [{"id": "a", "x": 1.0, "y": 1.0, "z": 1.0}]}
    for route, body in (("commands", HOVER), ("navigation", visit)):
        status, _, answer = ask(address, f"/v1/missions/own/{route}", body)
        assert (status, answer["text"]) == (403, "this needs the role pilot; viewer is viewer")
    assert not flying[1].commands


def test_a_pilot_flies_and_people_are_told(flying: tuple[FlightServer, Run]) -> None:
    """Commands and waypoints reach the drone; the answer is its own, and an alert repeats it."""
    server, run = flying
    status, _, answer = ask(server.address(), "/v1/missions/own/commands", HOVER)
    assert (status, answer["accepted"], answer["text"]) == (200, True, "so be it")
    waypoint = {"id": "a", "x": 1.5, "y": 2.5, "z": 3.5, "waypoint_type": "local", "priority": 1}
    body = {"robot": "drone", "waypoints": [waypoint], "deadline": 90.0}
    assert ask(server.address(), "/v1/missions/own/navigation", body)[0] == 200
    pause, visit = run.commands
    assert isinstance(pause, Pause)
    assert isinstance(visit, AddNavigation)
    assert visit.deadline == 90.0
    (place,) = visit.navigation
    assert isinstance(place, Waypoint)
    assert (place.x, place.y, place.z) == (1.5, 2.5, 3.5)
    assert run.notes == [
        "console_command: the console asked drone to pause: accepted: so be it",
        "console_command: the console asked drone to visit a: accepted: so be it",
    ]
    run.commands.clear()


@pytest.mark.parametrize(
    ("path", "body", "status", "text"),
    [
        ("/v1/missions/other/commands", HOVER, 404, "own"),
        ("/v1/missions/own/commands", {**HOVER, "robot": "ghost"}, 409, "ghost does not fly"),
        ("/v1/missions/own/commands", {**HOVER, "command": "loop"}, 422, "command"),
        ("/v1/missions/own/navigation", {"robot": "drone", "waypoints": []}, 422, "waypoints"),
        ("/v1/nothing", None, 404, "Not Found"),
        ("/v1/missions/", None, 404, "Not Found"),
    ],
)
def test_refusals_have_their_reason(
    flying: tuple[FlightServer, Run], path: str, body: object, status: int, text: str
) -> None:
    """As the service's do: a status and one text."""
    found = ask(flying[0].address(), path, body)
    assert found[0] == status
    assert text in found[2]["text"]


@pytest.mark.parametrize(
    "headers", [{"Host": "evil.example"}, {"Origin": "https://evil.example"}, {"Origin": "null"}]
)
def test_no_page_of_a_strangers_looks_on(
    flying: tuple[FlightServer, Run], headers: dict[str, str]
) -> None:
    """Nor one whose name was made to resolve to this machine; not even with the token."""
    assert ask(flying[0].address(), "/v1/missions", **headers)[0] == 403


def test_a_body_without_end_is_not_read(flying: tuple[FlightServer, Run]) -> None:
    """Its size is looked at first."""
    words = {"Content-Length": "2000000"}
    assert ask(flying[0].address(), "/v1/missions/own/commands", HOVER, **words)[0] == 413


def test_a_browsers_socket_brings_its_token_as_a_subprotocol(
    flying: tuple[FlightServer, Run],
) -> None:
    """The token itself is not sent back; the state has the waypoint's place."""
    address = flying[0].address(viewer=True)
    url = address.partition("/#")[0].replace("http", "ws") + "/v1/missions/own/live?rate=20"
    words = [Subprotocol("aerodaas"), Subprotocol(f"bearer.{token_of(address)}")]
    with connect(url, subprotocols=words) as socket:
        assert socket.subprotocol == "aerodaas"
        # Compressing each picture anew for each watcher would take most of the drone's processor.
        assert socket.protocol.extensions == []
        while True:
            message = json.loads(socket.recv(10))
            status = message["mission"]["status"].get("drone")
            if status:
                break
    assert message["now"] > 10**18
    target = {"id": "wp1", "x": 3, "y": 4, "z": 2, "waypoint_type": "local"}
    assert status["mission"]["target"] == target
    vehicle = status["vehicle"]
    assert vehicle["odometry"]["position"] == {"x": 1, "y": 2, "z": 3}
    assert vehicle["mode"] == "guided"
    with pytest.raises(InvalidStatus) as refused:
        connect(url, subprotocols=[Subprotocol("aerodaas"), Subprotocol("bearer.wrong")])
    assert refused.value.response.status_code == 401


def test_watchers_are_told_that_the_flight_is_over() -> None:
    """By the last state and an end, before the server is gone."""
    with ExitStack() as stack:
        server, _ = stack.enter_context(console())
        address = server.address()
        url = address.partition("/#")[0].replace("http", "ws") + "/v1/missions/own/live?rate=20"
        headers = {"Authorization": f"Bearer {token_of(address)}"}
        with connect(url, additional_headers=headers) as socket:
            socket.recv(10)
            stack.close()
            messages = [json.loads(text) for text in socket]
    assert messages[-1]["kind"] == "end"
    assert messages[-2]["mission"]["phase"] == "landed"


def test_what_is_no_token_is_none() -> None:
    """A token as a subprotocol counts only beside the name of ours."""
    assert bearer({"authorization": "Bearer  a "}) == "a"
    assert bearer({"sec-websocket-protocol": "aerodaas, bearer.b"}) == "b"
    assert bearer({"sec-websocket-protocol": "bearer.b"}) == ""
    assert bearer({"authorization": "Basic a"}) == ""


def test_an_address_in_use_is_named() -> None:
    """With the option that chooses another."""
    with console() as (server, _):
        taken = server.address().partition("//")[2].partition("/")[0]
        with pytest.raises(ConfigError, match="--console-address"):
            FlightServer(taken, "--console-address")


def test_the_list_before_take_off_is_told_to_whoever_watches() -> None:
    """With its age by the mission's clock; of known robots alone."""
    windy = HealthItem("wind", "12.0 m/s", "at most 10", Verdict.WARNING, "wait")
    with console() as (server, run):
        watcher = server.address(viewer=True)
        nothing: dict[str, Any] = {"age": None, "items": []}
        assert ask(watcher, "/v1/robots/drone/preflight")[2] == nothing
        run.health = HealthReport((windy,), 0.5)
        until(lambda: ask(watcher, "/v1/robots/drone/preflight")[2]["items"])
        found = ask(watcher, "/v1/robots/drone/preflight")[2]
        assert found["age"] == 0.5
        assert found["items"] == [{**asdict(windy), "verdict": "warning"}]
        status, _, answer = ask(watcher, "/v1/robots/other/preflight")
        assert (status, answer["text"]) == (404, "there is no robot other")
        assert ask(watcher, "/v1/robots/drone/preflight", token="")[0] == 401
