"""Each field of each message is recorded and read, or is named in the table as left out."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filled import filled, names
from synthetic_flight import PROVENANCE

from aerodaas.config.model import GeofenceConfig, RecordingConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import Decision, MissionPlan, MissionStatus, SetpointRecord
from aerodaas.messages.odometry import Battery
from aerodaas.messages.payload import Photo
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import PositionSetpoint, VehicleState, VelocitySetpoint
from aerodaas.messages.vitals import Vitals
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.recording.converters import Session, convert
from aerodaas.recording.messages import (
    CHANNELS,
    FrameInfo,
    Labels,
    NavigationRecord,
    json_entry,
    labels_and_message,
)
from aerodaas.recording.pictures import camera_of, detections, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder

HEADER = Header(4, 5, "drone/cam")
FOUND = filled(Detections)
ONE = dataclasses.replace(FOUND[0], appearance=None)
LEFT_OUT: dict[type, dict[str, Any]] = {
    VehicleState: {"video": ""},
    MissionStatus: {"pending": ()},
    Detections: {"items": (ONE,), "camera": None, "odometry": None, "nearest": None},
}
"""What takes the place of the fields that are recorded elsewhere, or nowhere."""
LABELS = dataclasses.asdict(filled(Labels))
MESSAGES = [
    *(
        filled(one.kind)
        for one in CHANNELS.values()
        if one.kind not in {GeofenceConfig, SetpointRecord}
    ),
    *(SetpointRecord(1, filled(kind), None) for kind in (PositionSetpoint, VelocitySetpoint)),
    GeofenceConfig(polygon=[(0, 0), (1, 0), (1, 1)], ceiling=20.0),
]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_each_field_is_recorded_and_read(message: Any) -> None:  # noqa: ANN401
    """A field that is added to a message needs no other line."""
    channel = next(one for one in CHANNELS.values() if one.kind is type(message))
    given = {name: LABELS[name] for name in channel.labels}
    entry = json_entry(message, "drone/it", 6, **given)
    labels, back = labels_and_message(entry.schema.name, entry.data)
    left_out = LEFT_OUT.get(type(message))
    assert back == (dataclasses.replace(message, **left_out) if left_out else message)
    assert labels == Labels(**given)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_the_schema_names_what_is_written(message: object) -> None:
    """Foxglove offers the fields that the schema names."""
    entry = json_entry(message, "drone/it", 6, robot="drone")
    described = json.loads(entry.schema.data)["properties"]
    assert set(described) == set(json.loads(entry.data))


@pytest.mark.parametrize(
    ("item", "kinds"),
    [
        (filled(VehicleState), {VehicleState}),
        (filled(MissionStatus), {MissionStatus, MissionPlan}),
        (filled(Decision), {Decision}),
        (filled(Alert), {Alert}),
        (filled(Battery), {Battery}),
        (filled(Photo), {Photo}),
        (filled(SetpointRecord), {SetpointRecord}),
        (filled(Vitals), {Vitals}),
        (filled(Frame), {FrameInfo}),
        (FOUND, {Detections}),
        (AeroNavigation(data=[filled(Waypoint)]), {NavigationRecord}),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_item_becomes_messages_of_the_table(item: object, kinds: set[type]) -> None:
    """With the labels that reading needs."""
    message = Message("drone/s", 1, 6, HEADER, 0, (), item)
    entries = convert(item, message, Session(RecordingConfig(), 0))
    written = [it for it in entries if it.schema.encoding == "jsonschema"]
    assert {CHANNELS[it.schema.name].kind for it in written} == kinds
    for it in written:
        labels, _ = labels_and_message(it.schema.name, it.data)
        assert labels.robot in {"drone", ""}


def test_navigation_is_recorded_whole() -> None:
    """With the priority that was given for all of it."""
    given = [filled(Waypoint), filled(VelocityCommand)]
    navigation = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, given, priority=2)
    entry = json_entry(NavigationRecord.of(navigation, HEADER), "drone/it")
    _, back = labels_and_message(entry.schema.name, entry.data)
    assert [*back.waypoints, *back.commands] == list(navigation)
    assert (back.header, back.type, back.priority) == (HEADER, navigation.navigation_type, 2)


def test_detections_and_cameras_are_read_as_they_were_recorded(tmp_path: Path) -> None:
    """By who shows and exports them: each field that is recorded at all."""
    path, frame = tmp_path / "flight.mcap", filled(Frame)
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for seq, (stream, item) in enumerate((("drone/cam", frame), ("drone/finder", FOUND))):
            recorder.write(Message(stream, seq, 6, HEADER, 0, (), item))
    with Recording.open(path) as recording:
        ((_, back),) = detections(recording, ["/drone/finder/detections"])
        values = {record.topic: record.value for record in recording.records()}
        (shot,) = shots(recording, ["/drone/cam/image"])
        depth = shot.depth()
    assert back == dataclasses.replace(FOUND, **LEFT_OUT[Detections])
    assert (shot.header, shot.odometry) == (frame.header, frame.odometry)
    np.testing.assert_array_equal(depth, frame.depth)
    camera = camera_of(values["/drone/cam/calibration"], values["/drone/cam/mount"])
    assert camera is not None
    for name in names(CameraModel):
        assert getattr(camera, name) == pytest.approx(getattr(frame.camera, name)), name


def test_a_body_of_which_no_joint_is_told_is_read_back() -> None:
    """JSON keeps no shape of what is empty."""
    bare = dataclasses.replace(ONE, keypoints=np.zeros((0, 3), np.float32))
    entry = json_entry(dataclasses.replace(FOUND, items=(bare,)), "drone/it")
    _, (back,) = labels_and_message(entry.schema.name, entry.data)
    assert back.keypoints is not None
    assert back.keypoints.size == 0


class Charge(Battery):
    """A plug-in's own reading."""


def test_a_derived_class_is_recorded_as_the_one_above_it() -> None:
    """And not as an item of a class that has no schema."""
    message = Message("drone/charge", 1, 6, HEADER, 0, (), Charge(0.25))
    (entry,) = convert(message.item, message, Session(RecordingConfig(), 0))
    assert (entry.schema.name, entry.topic) == ("aerodaas.Battery", "/drone/charge/battery")
    assert labels_and_message(entry.schema.name, entry.data)[1] == Battery(0.25)
