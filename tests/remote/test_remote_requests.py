"""Any requests of a remote user, in any order, against a real mission: the loop flies on."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import MutableMapping
from typing import Any

import numpy as np
import pytest
from flights import Flight
from hypothesis import example, given, settings
from hypothesis import strategies as st
from remote_flight import STREAM, on_its_way

from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import PositionSetpoint, VelocitySetpoint
from aerodaas.messages.waypoints import NavigationType, VelocityCommand
from aerodaas.mission.commands import StreamItem
from aerodaas.protocol.schemas import Role
from aerodaas.service.http.gate import Admission
from aerodaas.service.own.access import FlightTokens, principal_of
from aerodaas.service.own.flight import OwnFlight
from aerodaas.service.own.server import flight_app

LIMITS = LimitsConfig(
    max_range=60.0,
    max_speed=5.0,
    geofence=GeofenceConfig(polygon=[(-30, -30), (30, -30), (30, 30), (-30, 30)], ceiling=20.0),
)
_FASTEST = math.hypot(LIMITS.max_speed, LIMITS.max_climb)


class Api:
    """The API of a flight, without a network, and its drone that is on its way."""

    def __init__(self) -> None:
        run = on_its_way(LIMITS, 25.0)
        self.flown = run.flown
        self._flight = flight = OwnFlight(run, "survey")
        tokens = FlightTokens({}, anybody=principal_of("remote", Role.PILOT))
        self._app = flight_app(flight, Admission(tokens))

    def close(self) -> None:
        """End the flight's thread."""
        self._flight.close()

    def post(self, path: str, body: bytes) -> tuple[int, dict[str, Any]]:
        """One request: its status and JSON."""
        return self._ask("POST", path, body)

    def status(self) -> dict[str, Any]:
        """The drone's status."""
        _, mission = self._ask("GET", "", b"")
        found: dict[str, Any] = mission["status"]["drone"]["mission"]
        return found

    def _ask(self, method: str, path: str, body: bytes) -> tuple[int, dict[str, Any]]:
        sent: list[dict[str, Any]] = []

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": body, "more_body": False}

        async def send(message: MutableMapping[str, Any]) -> None:
            sent.append(dict(message))

        whole = f"/v1/missions/own{path}"
        scope = {
            "type": "http",
            "asgi": {"version": "3.0"},
            "http_version": "1.1",
            "method": method,
            "path": whole,
            "raw_path": whole.encode(),
            "root_path": "",
            "scheme": "http",
            "query_string": b"",
            "headers": [(b"content-type", b"application/json")],
        }
        asyncio.run(self._app(scope, receive, send))
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
    {"waypoints": lists, "robot": st.just("drone")},
    optional={"ordered": st.booleans(), "index": st.none() | edges | st.integers(0, 5)},
)


def order(name: str) -> bytes:
    """A command to the drone."""
    return json.dumps({"robot": "drone", "command": name}).encode()


posts = st.tuples(
    st.just("/navigation"),
    bodies.map(lambda body: json.dumps(body).encode()) | st.binary(max_size=40),
)
orders = st.sampled_from(["pause", "resume", "clear", "return-home", "land"]).map(
    lambda name: ("/commands", order(name))
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


@pytest.mark.slow
@given(asked=requests, pause=st.integers(1, 60))
@settings(max_examples=60)
@example(
    asked=[
        (
            "/navigation",
            b'{"robot": "drone", "waypoints": [{"id": "a", "x": 1, "y": 1, "z": 2}], "index": 1%s}'
            % (b"0" * 19),
        ),
    ],
    pause=20,
)
@example(asked=[VelocityCommand(1.0, valid_for=1e9), VelocityCommand(1e9, 1e9)], pause=10)
def test_no_sequence_of_requests_stops_the_loop(asked: list[Any], pause: int) -> None:
    """Each is taken or refused in words; setpoints stay finite and inside the limits."""
    api = Api()
    one = api.flown
    for request in asked:
        if isinstance(request, VelocityCommand):
            item = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [request])
            one.tell(StreamItem(STREAM, item))
        else:
            path, body = request
            code, answer = api.post(path, body)
            assert code in {200, 400, 422}, answer
            assert answer.get("accepted") or answer["text"] or answer["refused"]
        for _ in range(pause):
            one.turn()
        within_limits(one)
        said = api.status()
        assert said["state"] in {state.value for state in one.states}
        assert all(len(text) < 500 for text in said["faults"])
    kinds = {alert.kind for alert in one.mission.alerts}
    assert not kinds & {"command_failed", "motors_stopped", "geofence"}
    api.post("/commands", order("land"))
    api.close()
    one.run(120.0)
    assert one.mission.state is MissionState.LANDED
    within_limits(one)


@pytest.mark.parametrize(("index", "code"), [(10_000, 200), (10_001, 422), (10**40, 422)])
def test_an_index_beyond_the_queue_is_its_end_and_one_beyond_any_queue_is_refused(
    index: int, code: int
) -> None:
    """The waypoint is flown after the rest of its priority, or refused with the field's name."""
    api = Api()
    one = api.flown
    body = {"robot": "drone", "waypoints": [{"id": "last", "x": 1, "y": 1, "z": 2}], "index": index}
    answered, answer = api.post("/navigation", json.dumps(body).encode())
    assert answered == code
    assert code == 200 or "index" in answer["text"]
    api.close()
    one.run()
    assert one.status.visited == (("far", "last") if code == 200 else ("far",))
