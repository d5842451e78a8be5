"""The order of waypoints and control by hand at the console of one's own flight."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, cast

import pytest
from fastapi import WebSocket
from hovering import Run, ask, token_of, watched_console
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from aerodaas.errors import ConfigError
from aerodaas.mission.commands import (
    Answer,
    Command,
    RearrangeNavigation,
    ReleaseControls,
    Steer,
    TakeControls,
)
from aerodaas.service.live import controls
from aerodaas.service.live.controls import Freshness
from aerodaas.service.own.server import FlightServer

pytestmark = pytest.mark.wall_clock


@pytest.fixture(scope="module")
def watched() -> Iterator[tuple[FlightServer, Run]]:
    """A drone on its way to one waypoint, whose status is known."""
    with watched_console() as both:
        yield both


@pytest.fixture
def flying(watched: tuple[FlightServer, Run]) -> tuple[FlightServer, Run]:
    """The same, and it was told nothing yet."""
    watched[1].commands.clear()
    watched[1].notes.clear()
    return watched


@contextmanager
def hand(server: FlightServer, robot: str = "drone", **words: Any) -> Iterator[ClientConnection]:  # noqa: ANN401
    """Take the controls of a drone."""
    address = server.address(**words)
    url = address.partition("/#")[0].replace("http", "ws")
    headers = {"Authorization": f"Bearer {token_of(address)}"}
    where = f"{url}/v1/missions/own/controls?robot={robot}"
    with connect(where, additional_headers=headers) as socket:
        yield socket


def told(socket: ClientConnection) -> dict[str, Any]:
    """The next answer."""
    found: dict[str, Any] = json.loads(socket.recv(10))
    return found


def send(socket: ClientConnection, at: float, **axes: float) -> None:
    """Send a velocity of a moment in seconds of the page's own clock."""
    socket.send(json.dumps({"at": 1000 * at, **axes}))


def until(run: Run, kind: type[Command]) -> float:
    """Wait until the drone was given such a command; returns for how many seconds."""
    began = time.monotonic()
    while not any(isinstance(one, kind) for one in run.commands):
        assert time.monotonic() - began < 10
        time.sleep(0.01)
    return time.monotonic() - began


def test_the_order_is_one_command(flying: tuple[FlightServer, Run]) -> None:
    """With what is left out; people are told."""
    server, run = flying
    change = {"robot": "drone", "order": ["c", "b"], "remove": ["a"]}
    assert ask(server.address(), "/v1/missions/own/plan", change)[0] == 200
    assert run.commands == [RearrangeNavigation(("c", "b"), ("a",))]
    assert "fly c, b in this order and leave out a: accepted" in run.notes[0]
    many = {"robot": "drone", "order": [f"w{number}" for number in range(20)]}
    assert ask(server.address(), "/v1/missions/own/plan", many)[0] == 200
    assert "w6, w7, … (20) in this order" in run.notes[1]
    for bad in ({"order": [1]}, {"remove": [""]}, {"order": ["a"] * 1001}, {"first": 1}):
        body = {"robot": "drone", **bad}
        assert ask(server.address(), "/v1/missions/own/plan", body)[0] == 422


def test_a_viewer_does_none_of_it(flying: tuple[FlightServer, Run]) -> None:
    """The server refuses it, the socket before it is accepted."""
    server, run = flying
    address = server.address(viewer=True)
    body = {"robot": "drone", "order": ["a"]}
    assert ask(address, "/v1/missions/own/plan", body)[0] == 403
    with pytest.raises(InvalidStatus) as refused, hand(server, viewer=True):
        pass
    assert refused.value.response.status_code == 403
    assert not run.commands


def test_a_drone_is_steered_and_let_go(flying: tuple[FlightServer, Run]) -> None:
    """Each velocity is answered with its moment; the end of the connection lets go at once."""
    server, run = flying
    with hand(server) as socket:
        assert told(socket) == {"held": True, "at": 0, "text": "so be it"}
        send(socket, 1.0, forward=1.5, left=-0.5, up=0.25, yaw_rate=0.1)
        assert told(socket)["at"] == 1000
    assert until(run, ReleaseControls) < 0.5
    take, steer, release = run.commands
    assert isinstance(take, TakeControls)
    assert isinstance(steer, Steer)
    assert isinstance(release, ReleaseControls)
    assert take.operator == "pilot"
    assert take.session == steer.session == release.session != 0
    velocity = steer.velocity
    assert (velocity.forward, velocity.left, velocity.up, velocity.yaw_rate) == (
        1.5, -0.5, 0.25, 0.1,
    )  # fmt: skip
    assert velocity.valid_for <= 0.5
    while len(run.notes) < 2:
        time.sleep(0.01)
    assert run.notes == [
        "console_command: the console asked drone to be flown by hand by pilot: accepted: so be it",
        "console_command: the console asked drone to be let go of: accepted: so be it",
    ]


def test_who_falls_silent_loses_the_controls(flying: tuple[FlightServer, Run]) -> None:
    """The connection stands, and nothing is said: the drone is let go, the page told why."""
    server, run = flying
    with hand(server) as socket:
        assert told(socket)["held"]
        send(socket, 1.0, forward=1)
        assert told(socket)["held"]
        last = told(socket)
        assert (last["held"], last["text"]) == (False, "nothing was heard of this page for 1 s")
        with pytest.raises(ConnectionClosed):
            socket.recv(5)
    until(run, ReleaseControls)


def test_velocities_that_were_long_under_way_are_not_obeyed(
    flying: tuple[FlightServer, Run],
) -> None:
    """A network that stands still and then brings all at once moves no drone."""
    server, run = flying
    with hand(server) as socket:
        told(socket)
        send(socket, 1.0, forward=1)
        assert told(socket)["at"] == 1000
        time.sleep(0.4)
        for late in range(3):
            send(socket, 1.05 + 0.05 * late, forward=1)
        time.sleep(0.2)
        send(socket, 1.6, left=1)
        assert told(socket)["at"] == 1600
    steered = [one.velocity.left for one in run.commands if isinstance(one, Steer)]
    assert steered == [0, 1]


def test_a_velocity_that_waited_for_the_drone_is_not_obeyed(
    flying: tuple[FlightServer, Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drone that answers slowly is not flown by what was asked for meanwhile."""
    server, run = flying
    slow = run.command

    def answer_slowly(robot: str, command: Command) -> Answer:
        time.sleep(0.5 * isinstance(command, Steer))
        return slow(robot, command)

    monkeypatch.setattr(run, "command", answer_slowly)
    with hand(server) as socket:
        told(socket)
        send(socket, 1.0, forward=1)
        time.sleep(0.1)
        send(socket, 1.1, left=1)
        assert told(socket)["at"] == 1000
        time.sleep(0.2)
        send(socket, 1.8, up=1)
        assert told(socket)["at"] == 1800


class Talking:
    """The socket of somebody who steers without a pause."""

    scope: ClassVar[dict[str, object]] = {}

    def __init__(self) -> None:
        self.answers: list[dict[str, Any]] = []

    async def accept(self, subprotocol: str | None) -> None:
        """Be let in."""

    async def receive_text(self) -> str:
        """Steer."""
        await asyncio.sleep(0.01)
        return json.dumps({"at": 1000 * time.monotonic(), "forward": 1})

    async def send_text(self, text: str) -> None:
        """Hear an answer."""
        self.answers.append(json.loads(text))

    async def close(self) -> None:
        """Be gone."""


def test_who_may_not_fly_any_more_loses_the_controls(monkeypatch: pytest.MonkeyPatch) -> None:
    """A token that is revoked while its owner steers, as is found out at the next look."""
    monkeypatch.setattr(controls, "_RENEWAL_SECONDS", 0.2)
    given: list[Command] = []
    began = time.monotonic()

    def give(command: controls.ControlCommand) -> Answer:
        given.append(command)
        return Answer(accepted=True)

    def renew() -> None:
        if time.monotonic() - began > 0.3:
            raise ConfigError("this token was revoked")

    socket = Talking()
    session = controls.ControlSession(cast("WebSocket", socket), "asha", give, renew)
    asyncio.run(asyncio.wait_for(session.run(), 5))
    assert 2 <= sum(isinstance(one, Steer) for one in given) < 50
    assert isinstance(given[-1], ReleaseControls)
    assert (socket.answers[-1]["held"], socket.answers[-1]["text"]) == (
        False, "this token was revoked",
    )  # fmt: skip


def test_freshness_is_measured_against_the_quickest() -> None:
    """Whatever the two clocks say."""
    fresh = Freshness()
    assert fresh.is_fresh(100.0, 5.0)
    assert fresh.is_fresh(100.2, 5.39)
    assert not fresh.is_fresh(100.2, 5.41)
    assert fresh.is_fresh(101.0, 5.9), "a quicker one"
    assert not fresh.is_fresh(101.1, 6.21)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nonsense", "Invalid JSON"),
        ('{"forward": 1}', "at"),
        ('{"at": 1, "forward": 1e9}', "forward"),
        ('{"at": 1, "forward": NaN}', "forward"),
        ('{"at": 1, "backward": 1}', "backward"),
        ("[]", "object"),
    ],
)
def test_nonsense_ends_it(flying: tuple[FlightServer, Run], text: str, said: str) -> None:
    """With the reason, and the controls are let go."""
    server, run = flying
    with hand(server) as socket:
        told(socket)
        socket.send(text)
        answer = told(socket)
        assert (answer["held"], said in answer["text"]) == (False, True), answer
    until(run, ReleaseControls)
    assert not any(isinstance(one, Steer) for one in run.commands)


def test_a_drone_that_does_not_obey_ends_it(
    flying: tuple[FlightServer, Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What refuses the takeover, and what refuses later, is told; nothing is steered after it."""
    server, run = flying
    with pytest.raises(InvalidStatus), hand(server, "no%20name"):
        pass
    with hand(server, "ghost") as socket:
        assert told(socket) == {"held": False, "at": 0, "text": "ghost does not fly"}
        with pytest.raises(ConnectionClosed):
            socket.recv(5)
    with hand(server) as socket:
        told(socket)
        monkeypatch.setattr(run, "command", lambda *_: Answer(accepted=False, text="it leaves"))
        send(socket, 1.0, forward=1)
        assert told(socket) == {"held": False, "at": 1000, "text": "it leaves"}
        with pytest.raises(ConnectionClosed):
            socket.recv(5)
