"""Any requests of a remote user, in any order, against a real mission: the loop flies on."""

from __future__ import annotations

import asyncio
import json
import math
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from flights import Flight, add, flight, live
from hypothesis import example, given, settings
from hypothesis import strategies as st

from aerodaas.analytics.remote.app import build_app
from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import PositionSetpoint, VehicleState, VelocitySetpoint
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import Answer, Command, StreamItem

STREAM = "drone/remote"
LIMITS = LimitsConfig(
    max_range=60.0,
    max_speed=5.0,
    geofence=GeofenceConfig(polygon=[(-30, -30), (30, -30), (30, 30), (-30, 30)], ceiling=20.0),
)
_FASTEST = math.hypot(LIMITS.max_speed, LIMITS.max_climb)


@dataclass
class Link:
    """Hands what the service asks to a mission of this process."""

    flown: Flight

    def status(self) -> MissionStatus:
        """The mission's word."""
        return self.flown.status

    def vehicle(self) -> VehicleState:
        """The vehicle's state."""
        return self.flown.vehicle.read()

    def command(self, command: Command) -> Future[Answer]:
        """Answer at once."""
        future: Future[Answer] = Future()
        future.set_result(self.flown.tell(command))
        return future

    def fly(self, navigation: AeroNavigation, index: int | None = None) -> Future[Answer]:
        """Take navigation as an item of the stream."""
        return self.command(StreamItem(STREAM, navigation, index=index, replaces=False))

    def alert(self, alert: Alert) -> None:
        """Nobody watches."""


def ask(app: Any, method: str, path: str, body: bytes) -> tuple[int, dict[str, Any]]:  # noqa: ANN401
    """One request to the service itself, without a network: its status and JSON."""
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
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "scheme": "http",
        "query_string": b"",
        "headers": [(b"content-type", b"application/json")],
    }
    asyncio.run(app(scope, receive, send))
    content = b"".join(message.get("body", b"") for message in sent)
    return sent[0]["status"], json.loads(content)


edges = st.sampled_from(
    [0, -1, 1, 2**31, 2**63 - 1, 2**63, 18446744073709551615, 10**40, -(10**40)]
)
near = st.floats(-29, 29)
wild = st.floats() | st.sampled_from([1e308, -1e308, 5e-324, 1e-300, 1e300, -0.0]) | edges
positive = st.floats(0, 5) | wild
names = st.sampled_from(["a", "b", "far", "ä\U0001f681", "\x00", " "]) | st.text(max_size=70)
places = st.fixed_dictionaries(
    {"id": names, "x": near | wild, "y": near | wild, "z": st.floats(0.6, 15) | wild},
    optional={
        "hover_duration": positive,
        "waypoint_type": st.sampled_from(["relative", "local", "global", ""]),
        "yaw": st.none() | wild,
        "speed": st.none() | positive,
        "priority": st.integers(0, 9) | edges | st.integers(),
        "deadline": st.none() | positive,
    },
)
sane = st.fixed_dictionaries(
    {"id": st.text(min_size=1, max_size=3), "x": near, "y": near, "z": st.floats(0.6, 15)},
    optional={
        "priority": edges,
        "yaw": st.floats(allow_nan=False, allow_infinity=False),
        "speed": st.floats(min_value=0, exclude_min=True, allow_infinity=False),
        "hover_duration": st.floats(min_value=0, allow_infinity=False),
        "deadline": st.floats(100, allow_infinity=False),
    },
)
lists = st.one_of(
    st.lists(places, max_size=3),
    st.lists(sane, min_size=1, max_size=3, unique_by=lambda place: str(place["id"])),
)
bodies = st.fixed_dictionaries(
    {"waypoints": lists},
    optional={"ordered": st.booleans(), "index": st.none() | edges | st.integers(0, 5)},
)
posts = st.tuples(
    st.just("/waypoints"),
    bodies.map(lambda body: json.dumps(body).encode()) | st.binary(max_size=40),
)
orders = st.sampled_from(["pause", "resume", "clear", "return-home", "abort"]).map(
    lambda name: (f"/{name}", b"")
)
finite = st.floats(-1e9, 1e9)
velocities = st.builds(
    VelocityCommand,
    forward=finite,
    left=finite,
    up=finite,
    yaw_rate=finite,
    priority=edges,
    valid_for=st.floats(min_value=0, max_value=1e9, exclude_min=True),
)
requests = st.lists(posts | posts | posts | orders | velocities, max_size=8)


def within_limits(one: Flight) -> None:
    """What was sent is finite and no faster than allowed."""
    for record in one.records:
        sent = record.sent
        if isinstance(sent, PositionSetpoint):
            assert np.isfinite(sent.position).all()
            assert sent.yaw is None or math.isfinite(sent.yaw)
            assert one.mission.fence.contains(sent.position)
            assert sent.speed is not None
            assert 0.0 <= sent.speed <= _FASTEST + 1e-9
        elif isinstance(sent, VelocitySetpoint):
            assert np.isfinite(sent.velocity).all()
            assert math.isfinite(sent.yaw_rate)
            assert np.linalg.norm(sent.velocity) <= _FASTEST + 1e-9
    one.records.clear()


def in_flight() -> Flight:
    """A drone on its way."""
    one = flight(add(Waypoint("far", 25, 0, 2)), live(STREAM), limits=LIMITS)
    one.run_to(MissionState.ENROUTE)
    return one


@pytest.mark.slow
@given(asked=requests, pause=st.integers(1, 60))
@settings(max_examples=60)
@example(
    asked=[
        (
            "/waypoints",
            b'{"waypoints": [{"id": "a", "x": 1, "y": 1, "z": 2}], "index": 1%s}' % (b"0" * 19),
        ),
    ],
    pause=20,
)
@example(asked=[VelocityCommand(1.0, valid_for=1e9), VelocityCommand(1e9, 1e9)], pause=10)
def test_no_sequence_of_requests_stops_the_loop(asked: list[Any], pause: int) -> None:
    """Each is taken or refused in words; setpoints stay finite and inside the limits."""
    one = in_flight()
    app = build_app(Link(one), lambda: None)
    for request in asked:
        if isinstance(request, VelocityCommand):
            item = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [request])
            one.tell(StreamItem(STREAM, item))
        else:
            path, body = request
            code, answer = ask(app, "POST", path, body)
            assert code in {200, 400, 409, 422}, answer
            assert answer["accepted"] == (code == 200)
            assert answer["accepted"] or answer["text"] or answer["refused"]
        for _ in range(pause):
            one.turn()
        within_limits(one)
        code, said = ask(app, "GET", "/status", b"")
        assert code == 200
        assert said["state"] == one.mission.state.value
        assert all(len(text) < 500 for text in said["faults"])
    kinds = {alert.kind for alert in one.mission.alerts}
    assert not kinds & {"command_failed", "motors_stopped", "geofence"}
    ask(app, "POST", "/abort", b"")
    one.run(120.0)
    assert one.mission.state is MissionState.LANDED
    within_limits(one)


@pytest.mark.parametrize(("index", "code"), [(10_000, 200), (10_001, 422), (10**40, 422)])
def test_an_index_beyond_the_queue_is_its_end_and_one_beyond_any_queue_is_refused(
    index: int, code: int
) -> None:
    """The waypoint is flown after the rest of its priority, or refused with the field's name."""
    one = in_flight()
    app = build_app(Link(one), lambda: None)
    body = {"waypoints": [{"id": "last", "x": 1, "y": 1, "z": 2}], "index": index}
    answered, answer = ask(app, "POST", "/waypoints", json.dumps(body).encode())
    assert (answered, answer["accepted"]) == (code, code == 200)
    assert answer["accepted"] or "index" in answer["text"]
    one.run()
    assert one.status.visited == (("far", "last") if answer["accepted"] else ("far",))
