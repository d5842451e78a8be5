"""What a page is told of a recorded flight is what the recording has, within bounds."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from mcap.writer import Writer
from synthetic_flight import SyntheticFlight, record

from aerodaas.clock import seconds
from aerodaas.messages.mission import Decision
from aerodaas.messages.vehicle import VehicleState
from aerodaas.protocol.playback import RecordedOut
from aerodaas.recording.playback import flight as playback
from aerodaas.recording.playback import track
from aerodaas.recording.playback.flight import DecisionSums, read_flight
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.simulation.ground_plan import Shape

FLIGHT = SyntheticFlight(frames=2.0)
FLIGHT_END = [step.status for step in FLIGHT.steps()][-1]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A survey of four waypoints."""
    path = tmp_path_factory.mktemp("played") / "flight.mcap"
    record(path, FLIGHT)
    return path


def read(path: Path) -> RecordedOut:
    """The flight in a file."""
    with Recording.open(path) as recording:
        return read_flight(recording)[0]


def states(path: Path) -> dict[float, VehicleState]:
    """Recorded states by mission time."""
    with Recording.open(path) as recording:
        return {seconds(stamp): state for stamp, state in vehicle_states(recording, "tello")}


def test_states_are_those_of_the_recording(path: Path) -> None:
    """Each is a recorded one, at most a tenth of a second after the one before it."""
    told = read(path).tracks["tello"]
    recorded = states(path)
    times = [seconds(one.stamp) for one in told.states]
    assert len(times) > 0.9 * (max(recorded) - min(recorded)) / track.STATE_SECONDS
    for time, drawn in zip(times, told.states, strict=True):
        state = recorded[time]
        for name in ("odometry", "battery", "mode", "armed", "gps"):
            assert getattr(drawn, name) == getattr(state, name)
    gaps = [later - time for time, later in pairwise(times)]
    assert 0.99 * track.STATE_SECONDS < min(gaps) <= max(gaps) < 2 * track.STATE_SECONDS


def test_a_page_gets_no_secrets_of_a_state(path: Path) -> None:
    """Truth and further figures are the recording's alone, and as long as a stranger likes."""
    told = read(path).tracks["tello"].states
    assert all(not (one.truth or one.extra or one.faults or one.actuators) for one in told)


def test_statuses_tell_how_far_the_battery_lasts(path: Path) -> None:
    """Once a second at least; what was infinite, or not there, is not known."""
    told = read(path).tracks["tello"].statuses
    known = {
        seconds(one.stamp): one.outlook
        for one in told
        if one.outlook and not math.isnan(one.outlook.plan)
    }
    assert len(known) > 0.5 * len(told)
    for time, one in known.items():
        assert (one.plan, one.returns_at) == (0.2, 0.1)
        assert one.hover == pytest.approx(600.0 - time, abs=0.11)
    assert (told[0].outlook, told[-1].outlook) == (None, None)
    assert told[-1].distance == pytest.approx(FLIGHT_END.distance, abs=0.5)


def test_statuses_are_those_of_the_mission(path: Path) -> None:
    """At each step: state, reason, target, what lies ahead, what has been visited."""
    told = read(path).tracks["tello"]
    place, last = 0, None
    for step in SyntheticFlight().steps():
        status = step.status
        while place + 1 < len(told.statuses) and told.statuses[place + 1].stamp <= status.stamp:
            place += 1
        figures = {"stamp": 0, "distance": 0.0, "outlook": None}
        wanted = replace(status, pending=(), **figures)
        assert replace(told.statuses[place], **figures) == wanted, status.stamp
        plan = [one for one in told.plans if one.stamp <= status.stamp]
        ahead = told.ahead[place]
        pending = plan[-1].waypoints[-ahead:] if ahead else ()
        assert pending == status.pending
        last = wanted.state
    assert last == "landed"
    assert {one.id for plan in told.plans for one in plan.waypoints} == {
        "north", "far", "east", "start"
    }  # fmt: skip
    gaps = [later.stamp - one.stamp for one, later in pairwise(told.statuses)]
    assert max(gaps) < 1.2e9


def test_what_it_was_flown_in_and_what_happened(path: Path) -> None:
    """Name, times, alerts, streams; the environment without what is nobody's business."""
    flight = read(path)
    assert (flight.name, flight.remark) == ("farm_survey", "")
    assert flight.began == 1_750_000_000
    assert flight.end == seconds(FLIGHT_END.stamp)
    assert [(one.kind, one.text) for one in flight.alerts] == [
        ("battery_low", "the battery is at 20 %")
    ]
    assert flight.streams == {
        "tello/camera": "pictures",
        "tello/detector": "detections",
        "tello/follow": "navigation",
    }


def flown_in(path: Path, world: object, driver: str = "simulated") -> list[Shape]:
    """What a recording that says it was flown in this world shows below its flight."""
    environment = {"robots": [{"id": "x", "driver": driver}], "simulation": {"world": world}}
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        content = json.dumps(environment).encode()
        writer.add_attachment(0, 0, "environment.json", "application/json", content)
        schema = writer.register_schema("aerodaas.Alert", "jsonschema", b"{}")
        channel = writer.register_channel("/alerts", "json", schema)
        alert = {"stamp": 0, "kind": "k", "text": "t", "values": {}}
        writer.add_message(channel, 0, json.dumps(alert).encode(), 0)
        writer.finish()
    flight = read(path)
    assert flight.environment["robots"][0]["id"] == "x"
    return flight.scenery.shapes


def test_the_world_below_is_one_that_ships(tmp_path: Path) -> None:
    """A stranger's recording cannot have a file of the reader's read; a real drone flew in none."""
    path = tmp_path / "odd.mcap"
    own = tmp_path / "own.json"
    own.write_text('{"name": "own", "entities": [{"kind": "building", "id": "mine"}]}')
    for world in (str(own), "../worlds/campus", ["campus"], {"campus": 1}, None, 7):
        assert flown_in(path, world) == []
    assert {one.kind for one in flown_in(path, "campus")} == {"road", "building", "tree"}
    assert flown_in(path, "campus", driver="mavlink") == []


def test_one_that_breaks_off_plays_as_far_as_it_goes(path: Path, tmp_path: Path) -> None:
    """And says so; a damaged part in it is left out, and told of."""
    whole = read(path)
    data = bytearray(path.read_bytes())
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(len(data) * 0.6)])
    flight = read(cut)
    assert 0.2 * whole.end < flight.end < 0.9 * whole.end
    assert flight.remark == f"it breaks off at {flight.end:.1f} s"
    read_states = flight.tracks["tello"].states
    assert read_states == whole.tracks["tello"].states[: len(read_states)]
    with Recording.open(path) as recording:
        block = recording._index.blocks[1]
    data[block.offset + block.length // 2] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    assert read(damaged).remark == "1 damaged parts were left out"
    with Recording.open(damaged) as recording:
        # What is not asked for is not read.
        before = block.start - recording.epoch_ns - 1
        assert list(recording.records(until=before))
        assert recording.damaged == 0


def test_a_long_flight_is_thinned_out(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Evenly, from its start to its end."""
    monkeypatch.setattr(track, "_MOST_STATES", 100)
    thin = read(path).tracks["tello"].states
    recorded = states(path)
    assert 50 <= len(thin) <= 101
    times = [seconds(one.stamp) for one in thin]
    assert times[0] == min(recorded)
    assert times[-1] > 0.97 * max(recorded)
    for time, drawn in zip(times, thin, strict=True):
        assert drawn.odometry == recorded[time].odometry


def test_a_page_has_room_for_so_much(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What does not fit is counted, not kept."""
    monkeypatch.setattr(track, "_MOST_NAMES", 12)
    flight = read(path)
    told = flight.tracks["tello"]
    named = (
        sum(1 + len(plan.waypoints) for plan in told.plans)
        + len(flight.alerts)
        + sum(1 + len(one.visited) for one in told.statuses)
    )
    assert named <= 12
    assert "more than a page has room for" in flight.remark


def test_a_strangers_recording_is_no_flight_of_ours(tmp_path: Path) -> None:
    """Names that repeat, targets that are none: a message is told whole, or left out."""
    path = tmp_path / "odd.mcap"
    status = {
        "stamp": 10**9, "robot": "x", "state": "enroute", "reason": "", "visited": [],
        "given_up": [], "distance": 0.0,
    }  # fmt: skip
    place = {"x": 1.0, "y": 2.0, "z": 3.0}
    said = [
        {**status, "target": "wp1", "pending": -5, "faults": "none"},
        {**status, "target": {**place, "id": 7}},
        {**status, "stamp": 2 * 10**9, "pending": 10**9, "visits": 3},
        {**status, "stamp": 10**9, "target": {**place, "id": "late"}, "pending": 1.5},
    ]
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("aerodaas.MissionStatus", "jsonschema", b"{}")
        channels = [writer.register_channel(name, "json", schema) for name in ("/a", "/b")]
        plans = writer.register_schema("aerodaas.Plan", "jsonschema", b"{}")
        planned = writer.register_channel("/plan", "json", plans)
        plan = {"stamp": 0, "robot": "x", "waypoints": [{**place, "id": one} for one in "ab"]}
        writer.add_message(planned, 0, json.dumps(plan).encode(), 0)
        for number, value in enumerate(said):
            writer.add_message(channels[number % 2], number, json.dumps(value).encode(), number)
        for number in range(300):
            value = {**status, "robot": f"r{number}"}
            writer.add_message(channels[0], 10 + number, json.dumps(value).encode(), 0)
        writer.finish()
    flight = read(path)
    assert len(flight.tracks) == 256
    told = flight.tracks["x"].statuses
    assert [one.target and one.target.id for one in told] == [None, "late"]
    assert flight.tracks["x"].ahead == [10**9, 0]
    assert [one.stamp for one in told] == sorted(one.stamp for one in told)
    assert [one.visits for one in told] == [3, 0]
    assert flight.environment == {}


def outcome(time: float, action: str, reason: str, **values: float) -> Decision:
    """A decision as it is recorded."""
    return Decision(round(time * 1e9), "m#1", action, reason, values)


def test_decisions_are_summed_up_as_a_dispatcher_does() -> None:
    """Outcomes count once, where they ran; what only says what is going to be does not count."""
    sums = DecisionSums()
    for value in (
        outcome(1.0, "edge", "in time"),
        outcome(1.1, "done", "edge: in time", qos_total=5.0, qoe_total=1.0),
        outcome(1.2, "cloud", "edge is full"),
        outcome(1.2, "retry", "it died"),
        outcome(1.3, "late", "cloud", qos_total=4.0, qoe_total=1.0),
        outcome(1.4, "timeout", "cloud: edge is full", qos_total=3.0),
        outcome(1.5, "failed", "edge"),
        outcome(1.6, "drop", "cannot finish in time"),
        outcome(1.7, "dropped", "no room in the cloud in time"),
    ):
        sums.add(value)
    last = sums.rows[-1]
    assert (last.time, last.in_time, last.late, last.dropped) == (1.7, 1, 3, 2)
    assert (last.edge, last.cloud, last.qos, last.qoe) == (2, 2, 3.0, 1.0)
    assert [one.time for one in sums.rows] == [1.1, 1.6, 1.7]


def test_many_decisions_are_thinned_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """To rows that grow, the last of which has everything."""
    monkeypatch.setattr(playback, "_MOST_ROWS", 20)
    sums = DecisionSums()
    for number in range(1000):
        sums.add(outcome(number, "done", "edge"))
    rows = sums.rows
    assert len(rows) <= 22
    assert [one.in_time for one in rows] == sorted(one.in_time for one in rows)
    gaps = [later.time - one.time for one, later in pairwise(rows[:-1])]
    assert max(gaps) <= 4 * min(gaps)
    assert (rows[-1].time, rows[-1].in_time) == (999, 1000)
