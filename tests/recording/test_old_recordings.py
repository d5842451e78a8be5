"""Recordings and documents of earlier formats are read whole.

`old/format_1.mcap` is a flight that the last revision of format 1 recorded (most of its repeated
messages were left out afterwards), and `old/mission_1.json` a document that it compiled.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from aerodaas import Environment
from aerodaas.cli.lab.recorded_workload import RecordedWorkload
from aerodaas.clock import NANOSECONDS
from aerodaas.dataflow.mission_document import read_mission
from aerodaas.environment.document.building import build_mission
from aerodaas.messages.detections import Detection
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import PositionSetpoint
from aerodaas.messages.waypoints import FollowedTarget, TargetState
from aerodaas.recording.messages import CHANNELS
from aerodaas.recording.pictures import detections, frames
from aerodaas.recording.playback.flight import read_flight
from aerodaas.recording.reader import Recording
from aerodaas.recording.replay.environment import read_timetables, replay_environment
from aerodaas.recording.report.difference import difference
from aerodaas.recording.report.report import read_report
from aerodaas.recording.tables import table_of

OLD = Path(__file__).with_name("old")
APPS = Path(__file__).resolve().parents[2] / "apps"
FLIGHT = OLD / "format_1.mcap"
BOX = (2.0, 3.0, 10.0, 20.0)


def test_each_message_of_an_old_recording_is_read() -> None:
    """And each is of its class."""
    with Recording.open(FLIGHT) as recording:
        counts = sum(topic.count for topic in recording.topics.values())
        found = list(recording.records())
        assert (len(found), recording.damaged) == (counts, 0)
    ours = [one for one in found if one.schema in CHANNELS]
    assert all(isinstance(one.value, CHANNELS[one.schema].kind) for one in ours)
    names = {one.schema.removeprefix("aerodaas.") for one in ours}
    assert names == {
        *("VehicleState", "MissionStatus", "Plan", "Geofence", "Setpoint", "Frame", "Detections"),
        *("Navigation", "Value", "Decision", "Alert", "Latency", "Vitals"),
    }


def test_the_figures_of_an_old_recording_are_those_that_were_written() -> None:
    """States, setpoints, vitals, decisions and navigation."""
    with Recording.open(FLIGHT) as recording:

        def last(schema: str) -> Any:  # noqa: ANN401 - of the schema's class
            *_, record = recording.records(schemas=[f"aerodaas.{schema}"])
            return record.value

        status, alert, decision = map(last, ("MissionStatus", "Alert", "Decision"))
        ((topic, found), *_) = detections(recording)
        (pictured, *_) = frames(recording)
        states = list(recording.records(schemas=["aerodaas.VehicleState"]))
        setpoints = list(recording.records(schemas=["aerodaas.Setpoint"]))
        *_, vitals = recording.records(schemas=["aerodaas.Vitals"])
        *_, navigation = recording.records(schemas=["aerodaas.Navigation"])
    assert (status.state, status.visited, status.visits) == (MissionState.LANDED, ("a", "b"), 2)
    assert alert.values == {"score": 0.75}
    assert decision.action == "done"
    assert {one.labels.robot for one in states} == {"drone"}
    assert states[0].value.gps.satellites > 0
    assert states[-1].value.truth is not None
    assert any(isinstance(one.value.asked, PositionSetpoint) for one in setpoints)
    assert topic == "/drone/finder/detections"
    assert list(found) == [Detection(BOX, "person", 0.75, 1)]
    assert (pictured.header.source, pictured.image.shape) == ("drone/cam1", (24, 32, 3))
    assert pictured.odometry is not None
    assert vitals.value.memory > 1e6
    assert vitals.labels.actor
    assert isinstance(navigation.value.header, Header)
    (command,) = navigation.value.commands
    assert command.target == FollowedTarget(TargetState.SURE, BOX, 1)


def test_an_old_recording_has_a_report() -> None:
    """With plots, and it agrees with itself."""
    report = read_report(FLIGHT)
    robot = report.summary.robots["drone"]
    assert robot.outcome == "landed: all waypoints are visited"
    assert (robot.waypoints_visited, robot.waypoints_planned) == (2, 2)
    assert report.plots
    compared = difference(FLIGHT, FLIGHT)
    assert compared.agrees
    assert compared.streams


def test_an_old_recording_is_played() -> None:
    """With its plan, and with what was found and followed in each picture."""
    with Recording.open(FLIGHT) as recording:
        flight, film = read_flight(recording)
        last, *_ = film.at("drone/cam1", 10 * NANOSECONDS)[::-1]
        kinds = [one["item"]["is"] for one, _ in film.at("drone/cam1", 10 * NANOSECONDS)]
    assert last[0]["captured"] <= 10 * NANOSECONDS
    assert kinds == ["Detections", "Target", "Picture"]
    track = flight.tracks["drone"]
    assert {one.id for plan in track.plans for one in plan.waypoints} == {"a", "b"}
    told = zip(track.statuses, track.ahead, strict=True)
    first = [(one, ahead) for one, ahead in told if one.target and one.target.id == "a"]
    assert {(ahead, one.waypoint_counts) for one, ahead in first} == {(1, (0, 2))}
    assert [one.kind for one in flight.alerts] == ["person"]
    assert flight.analytics[-1].in_time == 14


def test_an_old_recording_has_tables_and_is_replayed() -> None:
    """Tables have its fields as it has them."""
    with Recording.open(FLIGHT) as recording:
        rows = {topic: table_of(recording, topic) for topic in recording.topics}
    assert rows["/alerts"][0]["source"] == "analytics/drone/finder"
    assert rows["/drone/status/mission"][0]["robot"] == "drone"
    assert len(read_timetables(FLIGHT)["drone/cam1"]) == 7
    assert replay_environment(FLIGHT).robots[0].driver == "replayed"
    assert [one.model for one in RecordedWorkload.read(FLIGHT).tasks] == ["drone/finder"] * 14


def test_an_old_document_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    """With each of its analyses."""
    monkeypatch.chdir(APPS)
    document = read_mission(OLD / "mission_1.json")
    environment = Environment("environments/rescue.json")
    build_mission(document, environment, OLD / "models")
    assert len(environment.graph.nodes) >= len(document.analyses)
