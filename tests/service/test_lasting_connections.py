"""Connections that last: they end with their token, their role and their user."""

from __future__ import annotations

import contextlib
import http.client
import json
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, cast

import pytest
from served import document, fleet, robot
from served_flight import Drones, ServedFlight
from waiting import until
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from aerodaas.analytics.here.relay import LARGEST_ANSWER, HereRelay, HereUser
from aerodaas.config.model import EnvironmentConfig
from aerodaas.http_server.addresses import listen
from aerodaas.mission.commands import Answer, Steer
from aerodaas.protocol.piloting import ControlsIn
from aerodaas.protocol.schemas import USUAL_SCOPES, AccountIn, MissionPhase, Role, Scope, TokenIn
from aerodaas.service import mission as missions
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.access.principal import Principal
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.orders import FlightOrder
from aerodaas.service.flights.server import LeaseWatch
from aerodaas.service.http import bodies
from aerodaas.service.http.limits import PROVIDER
from aerodaas.service.http.server import web_server
from aerodaas.service.live import controls as hand
from aerodaas.service.live import session
from aerodaas.service.mission_service import MissionService
from aerodaas.service.models.model_store import ModelStore
from aerodaas.service.provider import build_service
from aerodaas.service.routes import here
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

pytestmark = pytest.mark.wall_clock

ENOUGH = 20.0
SEEN = {
    "id": "one/seen",
    "here": {"produces": "Detections"},
    "reads": ["one/cam"],
}


class Process:
    """A process that runs."""

    def poll(self) -> int | None:
        """None."""


class Service:
    """A service in this process, whose flights are the test's."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "fleet.json"
        drone = robot("one")
        drone["sensors"].append({"id": "cam", "type": "camera"})
        self.path.write_text(json.dumps(fleet(drone)), encoding="utf-8")
        config = EnvironmentConfig.load(self.path)
        self.settings = ServiceSettings(
            self.path, config, folder / "s", rehearse=False, monitor=False
        )
        self.settings.state.mkdir()
        self.file = folder / "service.db"
        self.store = Store.open(self.file)
        self.accounts = Accounts(self.store)
        self.services: list[MissionService] = []
        self.port = 0
        self.relay: HereRelay | None = None
        self.token("root", role=Role.ADMIN)

    def token(self, name: str, *scopes: Scope, role: Role = Role.PILOT, of: str = "farm") -> str:
        """A token of an account, which is made if it is new."""
        with contextlib.suppress(Exception):
            self.accounts.add(AccountIn(name=name, tenant=of, role=role))
        made = self.accounts.issue(TokenIn(account=name, scopes=list(scopes or USUAL_SCOPES)))
        return str(made.secret)

    def revoke(self, name: str) -> None:
        """Revoke an account's tokens."""
        for one in self.store.tokens.all(name):
            self.accounts.revoke(one.id)

    @contextlib.contextmanager
    def socket(self, path: str, token: str) -> Iterator[ClientConnection]:
        """A WebSocket."""
        url = f"ws://127.0.0.1:{self.port}/v1/missions/{path}"
        headers = {"Authorization": f"Bearer {token}"}
        with connect(url, additional_headers=headers, open_timeout=ENOUGH) as found:
            yield found

    def status(self, method: str, path: str, token: str, body: object = None) -> int:
        """Status of the answer to a request."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=ENOUGH)
        headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
        connection.request(method, f"/v1/{path}", json.dumps(body) if body else None, headers)
        with contextlib.closing(connection):
            return connection.getresponse().status

    def submit(self, **changes: object) -> str:
        """A mission whose user's side sees by a camera; returns its id once it flies."""
        from aerodaas.protocol.schemas import MissionIn  # noqa: PLC0415 - a request

        self.token("asha")
        pilot = Principal("asha", "farm", Role.PILOT, frozenset(USUAL_SCOPES), "t")
        sensors = ["one/odometry", "one/cam"]
        flight = document("one", (5, 0), sensors=sensors, analyses=[SEEN], **changes)
        (missions,) = self.services
        return missions.submit(pilot, MissionIn.model_validate({"document": flight})).id

    def fly(self, mission: str) -> ServedFlight:
        """The flight's own end, once the service has begun it."""
        (missions,) = self.services
        until(lambda: missions.shown(mission).phase is MissionPhase.FLYING)
        folder = FlightFolder(self.settings.missions / mission / "f")
        watch = LeaseWatch(FlightOrder.read(folder.order), lambda _: None)
        flight = ServedFlight(folder, Drones(self.settings.config), watch)
        self.relay = flight.relay
        return flight


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    """A service that looks at its connections often."""
    for module in (session, hand):
        monkeypatch.setattr(module, "_RENEWAL_SECONDS", 0.1)
    monkeypatch.setattr(here, "_AGAIN_SECONDS", 0.05)
    monkeypatch.setattr(missions, "start_process", lambda *_, **__: Process())
    start = MissionService.start
    with tempfile.TemporaryDirectory(prefix="lasting-", dir="/tmp") as folder:
        made = Service(Path(folder))

        def started(service: MissionService) -> None:
            made.services.append(service)
            start(service)

        monkeypatch.setattr(MissionService, "start", started)
        server = web_server(build_service(made.settings, made.store), PROVIDER)
        with listen("127.0.0.1", 0) as listener:
            made.port = listener.getsockname()[1]
            thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
            thread.start()
            until(lambda: made.services)
            yield made
            server.should_exit = True
            thread.join(ENOUGH)
        made.store.close()


def closed(socket: ClientConnection) -> bool:
    """Whether the service ends a connection, of whose messages nobody makes anything."""
    try:
        while True:
            socket.recv(ENOUGH)
    except ConnectionClosed:
        return True
    except TimeoutError:
        return False


@pytest.mark.parametrize("change", ["token", "account", "role"])
def test_the_users_side_ends_with_its_token(service: Service, change: str) -> None:
    """It sees by the mission's cameras and steers by what it answers."""
    mission = service.submit()
    flight = service.fly(mission)
    with service.socket(f"{mission}/here", service.token("ivan")) as socket:
        assert service.relay is not None
        assert service.relay.wait_attached(ENOUGH)
        if change == "token":
            service.revoke("ivan")
        elif change == "account":
            service.accounts.change("ivan", disabled=True)
        else:
            service.accounts.change("ivan", role=Role.VIEWER)
        assert closed(socket)
    until(lambda: not cast("HereRelay", service.relay)._attached.is_set())
    flight.close()


@pytest.mark.parametrize("lacks", USUAL_SCOPES)
def test_the_users_side_needs_what_submitting_needs(service: Service, lacks: Scope) -> None:
    """Its pictures, its navigation and its analyses would be had without the scope."""
    mission = service.submit()
    token = service.token("ivan", *(one for one in USUAL_SCOPES if one is not lacks))
    with pytest.raises(InvalidStatus) as refused, service.socket(f"{mission}/here", token):
        pass
    assert refused.value.response.status_code == 403
    assert f"not good for {lacks.value}" in (refused.value.response.body or b"").decode()


def test_a_user_who_leaves_before_the_flight_is_waited_for_no_longer(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each that was would hold one of the service's places until the mission is over."""
    monkeypatch.setattr(MissionService, "flight", lambda *_: None)
    left: list[bool] = []
    answer = here._User.answer

    async def noted(user: here._User) -> None:
        try:
            await answer(user)
        finally:
            left.append(True)

    monkeypatch.setattr(here._User, "answer", noted)
    mission = service.submit()
    with service.socket(f"{mission}/here", service.token("ivan")) as socket:
        socket.send(json.dumps({"number": 1}))
    until(lambda: left)


def test_a_flights_question_is_answered_by_the_users_side(service: Service) -> None:
    """Also by one that was there before the flight, and one that came anew; with a picture."""
    mission = service.submit()
    token = service.token("ivan")
    with service.socket(f"{mission}/here", token) as before:
        flight = service.fly(mission)
        relay = cast("HereRelay", service.relay)
        assert relay.wait_attached(ENOUGH)
        assert _answered(relay, before) == {"item": 7}
    until(lambda: not relay._attached.is_set())
    with service.socket(f"{mission}/here", token) as again:
        assert relay.wait_attached(ENOUGH)
        assert _answered(relay, again) == {"item": 7}
    flight.close()


def _answered(relay: HereRelay, socket: ClientConnection) -> dict[str, Any]:
    """What a question becomes to which the user says 7."""
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(relay.ask, {"do": "process", "key": "one/seen"}, b"picture")
        question = json.loads(socket.recv(ENOUGH))
        assert (question["key"], question["blob"]) == ("one/seen", True)
        assert socket.recv(ENOUGH) == b"picture"
        socket.send(json.dumps({"number": question["number"], "item": 7, "blob": False}))
        return asked.result()


def test_what_the_users_side_says_reaches_the_flight(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Except what is longer than any answer, which ends the connection before it is read."""
    heard: list[dict[str, Any]] = []
    monkeypatch.setattr(HereRelay, "waits", True)
    monkeypatch.setattr(HereUser, "answered", lambda _, message, __: heard.append(message))
    mission = service.submit()
    flight = service.fly(mission)
    with service.socket(f"{mission}/here", service.token("ivan")) as socket:
        assert service.relay is not None
        assert service.relay.wait_attached(ENOUGH)
        # The service may not have noticed yet that it is connected.
        until(lambda: socket.send(json.dumps({"number": 1, "item": None})) or heard)
        # It may be closed while the rest is on its way.
        with contextlib.suppress(ConnectionClosed):
            socket.send(json.dumps({"number": 2, "item": "x" * 2 * LARGEST_ANSWER}))
        assert closed(socket)
    assert {one["number"] for one in heard} == {1}
    flight.close()


def test_wrong_tokens_beside_it_keep_no_view_open(service: Service) -> None:
    """Of which there may be so many from one address that each is told to wait."""
    mission = service.submit()
    with service.socket(f"{mission}/live", service.token("ivan")) as socket:
        socket.recv(ENOUGH)
        for _ in range(12):
            with pytest.raises(InvalidStatus), service.socket(f"{mission}/live", "wrong"):
                pass
        service.revoke("ivan")
        assert closed(socket)


def test_an_operators_hand_is_a_pilots_once_the_role_is_gone(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another tenant's drone is not steered any more."""
    asked: list[tuple[Role, str]] = []

    def fly(_: MissionService, who: Any, mission: str, what: ControlsIn) -> Answer:  # noqa: ANN401
        del mission
        asked.append((who.role, "steers" if isinstance(what.command, Steer) else "takes or leaves"))
        return Answer(accepted=True)

    monkeypatch.setattr(MissionService, "fly", fly)
    monkeypatch.setattr(hand, "_SILENT_SECONDS", ENOUGH)
    mission = service.submit()
    flight = service.fly(mission)
    operator = service.token("olga", role=Role.OPERATOR, of="provider")
    with service.socket(f"{mission}/controls?robot=one", operator) as socket:
        assert json.loads(socket.recv(ENOUGH))["held"]
        service.accounts.change("olga", role=Role.PILOT)
        until(lambda: _steers(socket, asked) is Role.PILOT)
    flight.close()


def _steers(socket: ClientConnection, asked: list[tuple[Role, str]]) -> Role | None:
    socket.send(json.dumps({"at": 1000 * time.monotonic(), "forward": 1}))
    socket.recv(ENOUGH)
    roles = [role for role, what in asked if what == "steers"]
    return roles[-1] if roles else None


def test_who_was_refused_is_not_remembered_while_the_database_is_gone(service: Service) -> None:
    """Not even where the token was never tried after that; others command on."""
    root, ivan = service.token("root"), service.token("ivan")
    assert service.status("GET", "fleet", ivan) == 200
    (token,) = [one.id for one in service.store.tokens.all("ivan")]
    assert service.status("DELETE", f"tokens/{token}", root) == 200
    olga = service.token("olga")
    assert service.status("GET", "fleet", olga) == 200
    change = {"scopes": ["sense"]}
    assert service.status("PATCH", "accounts/olga", root, change) == 200
    service.file.rename(service.file.with_suffix(".away"))
    assert service.status("GET", "fleet", root) == 200
    assert service.status("GET", "fleet", ivan) == 503
    assert service.status("GET", "fleet", olga) == 503
    service.file.with_suffix(".away").rename(service.file)


def test_a_model_that_is_kept_holds_up_nobody(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its hash and the disk take a while, and a command may be waiting."""
    begun, free = threading.Event(), threading.Event()

    def put(*_: object) -> None:
        begun.set()
        assert free.wait(ENOUGH)

    monkeypatch.setattr(ModelStore, "put", put)
    token = service.token("ivan")
    with ThreadPoolExecutor(1) as pool:
        kept = pool.submit(service.status, "PUT", f"models/{'0' * 64}", token, "model")
        assert begun.wait(ENOUGH)
        assert service.status("GET", "fleet", token) == 200
        free.set()
        assert kept.result() == 204


def test_a_velocity_is_no_longer_than_one(service: Service) -> None:
    """What would take a gigabyte as JSON is not read as such."""
    mission = service.submit()
    flight = service.fly(mission)
    with service.socket(f"{mission}/controls?robot=one", service.token("ivan")) as socket:
        socket.recv(ENOUGH)
        socket.send('{"at": 0, "forward": 1' + " " * 10_000 + "}")
        assert not json.loads(socket.recv(ENOUGH))["held"]
    flight.close()


@pytest.mark.parametrize("length", [10, 3 << 20])
def test_who_may_only_look_is_refused_before_the_body_is_sent(
    service: Service, length: int
) -> None:
    """It would be read and checked for nothing."""
    assert (
        _status_of_length(service, "missions", service.token("vera", role=Role.VIEWER), length)
        == 403
    )


@pytest.mark.parametrize(
    ("path", "length"),
    [
        ("missions", 5 << 20),
        ("missions/x/navigation", 2 << 20),
        ("models/x", 65 << 20),
        ("leases", 100_000),
    ],
)
def test_a_body_is_as_large_as_what_it_is_for(service: Service, path: str, length: int) -> None:
    """And no larger, by its length alone."""
    assert _status_of_length(service, path, service.token("ivan"), length) == 413


def _status_of_length(service: Service, path: str, token: str, length: int) -> int:
    """Answer to a request that says how long its body is, and sends none."""
    connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=ENOUGH)
    with contextlib.closing(connection):
        connection.putrequest("POST", f"/v1/{path}")
        connection.putheader("Authorization", f"Bearer {token}")
        connection.putheader("Content-Type", "application/json")
        connection.putheader("Content-Length", str(length))
        connection.endheaders()
        return connection.getresponse().status


PLACES = [{"id": f"a{number}", "x": 1.0, "y": 1.0, "z": 2.0} for number in range(4000)]
HOSTILE: dict[str, tuple[dict[str, Any], int]] = {
    "no waypoints": ({"navigation": [{"robot": "one", "waypoints": [0] * 9000}] * 32}, 413),
    "many values": ({"name": [0] * 400_000}, 413),
    "many lists": ({"name": [[]] * 200_000}, 413),
    "many keys": ({f"key{number}": 0 for number in range(20_000)}, 413),
    "one with many keys": (
        {"name": [{}] * 500, "more": {f"key{number}": 0 for number in range(20_000)}},
        422,
    ),
    "many settings": (
        {"analyses": [{"id": "one/a", "analysis": "X", "settings": {"a": [[0] * 150] * 150}}]},
        422,
    ),
    "many waypoints": ({"navigation": [{"robot": "one", "waypoints": PLACES}] * 3}, 422),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_document_that_takes_long_to_check_is_refused(service: Service, name: str) -> None:
    """By its counts, and in a sentence."""
    changes, status = HOSTILE[name]
    body = {"document": document("one", (5, 0)) | changes}
    assert service.status("POST", "missions", service.token("ivan"), body) == status


def test_a_document_that_is_checked_keeps_no_command_waiting(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is parsed beside the loop."""
    begun, free, content = threading.Event(), threading.Event(), bodies._content

    def slow(*words: Any) -> Any:  # noqa: ANN401
        begun.set()
        assert free.wait(ENOUGH)
        return content(*words)

    monkeypatch.setattr(bodies, "_content", slow)
    mission = service.submit()
    flight = service.fly(mission)
    token = service.token("ivan")
    places = [(float(number % 9), 0.0) for number in range(100)]
    with ThreadPoolExecutor(1) as pool:
        body = {"document": document("one", *places)}
        submitted = pool.submit(service.status, "POST", "missions", token, body)
        assert begun.wait(ENOUGH)
        command = {"robot": "one", "command": "pause"}
        assert service.status("POST", f"missions/{mission}/commands", token, command) == 200
        free.set()
        assert submitted.result() == 202
    flight.close()


def test_a_command_waits_for_nothing_that_the_desk_does(service: Service) -> None:
    """It may read a large document, or write to a slow disk."""
    mission = service.submit()
    flight = service.fly(mission)
    (missions,) = service.services
    until(lambda: missions._missions[mission].link is not None)
    words = "POST", f"missions/{mission}/commands", service.token("ivan")
    with ThreadPoolExecutor(1) as pool, missions._lock:
        command = {"robot": "one", "command": "return-home"}
        assert pool.submit(service.status, *words, command).result(ENOUGH) == 200
    flight.close()


def test_an_answer_that_nobody_waits_for_is_not_even_parsed(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The flight has commands to answer; what is no JSON ends no connection."""
    heard: list[object] = []
    monkeypatch.setattr(HereUser, "answered", lambda _, message, __: heard.append(message))
    mission = service.submit()
    flight = service.fly(mission)
    relay = cast("HereRelay", service.relay)
    with service.socket(f"{mission}/here", service.token("ivan")) as socket:
        assert relay.wait_attached(ENOUGH)
        socket.send(json.dumps({"number": 1, "item": [[]] * 100_000}))
        socket.send("[" * 50_000)
        with ThreadPoolExecutor(1) as pool:
            pool.submit(relay.ask, {"do": "process", "key": "one/seen"}, b"")
            question = json.loads(socket.recv(ENOUGH))
            socket.send(json.dumps({"number": question["number"], "item": [[]] * 100_000}))
            socket.send(json.dumps({"number": question["number"], "item": 7}))
            until(lambda: heard)
    assert heard == [{"number": question["number"], "item": 7}]
    flight.close()
