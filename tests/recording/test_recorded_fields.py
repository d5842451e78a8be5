"""Whatever a class may hold is recorded, or is named here as left out on purpose."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filled import filled, names
from synthetic_flight import PROVENANCE

from aerodaas.config.model import RecordingConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import Decision, MissionStatus, SetpointRecord
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.payload import Photo
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import PositionSetpoint, VehicleState, VelocitySetpoint
from aerodaas.messages.vitals import Vitals
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.recording.converters import Session, convert
from aerodaas.recording.pictures import detections, detections_of, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorded_camera import camera_of
from aerodaas.recording.recorder import FlightRecorder

HEADER = Header(4, 5, "drone/cam")
NOWHERE = ""
"""Recorded under no name, on purpose."""
ELSEWHERE: dict[type, dict[str, str]] = {
    # The password that it may hold.
    VehicleState: {"video": NOWHERE},
    # The plan has the waypoints; progress is the quotient.
    MissionStatus: {"waypoint_counts": "progress"},
    # Made from the picture, which is recorded: clothes by their colours, and the depth beside it.
    Detection: {"appearance": NOWHERE},
    Detections: {"header": "stamp", "camera": NOWHERE, "odometry": NOWHERE, "nearest": NOWHERE},
    # In messages of their own: picture, depth, calibration and mount.
    Frame: {"header": "stamp", "image": NOWHERE, "camera": NOWHERE, "depth": NOWHERE},
    Alert: {"header": "stamp"},
    # As exact as it is drawn; by the pictures' own exact place.
    Photo: {"truth": NOWHERE},
    Vitals: {"taken": "stamp", "memory": "memory_mb"},
}
"""Fields by the name under which they are recorded, where that is another."""


def recorded(item: object) -> list[dict[str, Any]]:
    """The JSON messages of an item."""
    message = Message("drone/s", 1, 6, HEADER, 0, (), item)
    entries = convert(item, message, Session(RecordingConfig(), 0))
    return [json.loads(it.data) for it in entries if it.schema.encoding == "jsonschema"]


def lost(kind: type, found: Mapping[str, Any]) -> set[str]:
    """Fields of a class that a recorded object has not."""
    known = ELSEWHERE.get(kind, {})
    return {name for name in names(kind) if known.get(name, name) not in {NOWHERE, *found}}


@pytest.mark.parametrize(
    "kind",
    [
        VehicleState,
        MissionStatus,
        Decision,
        Alert,
        Battery,
        Photo,
        SetpointRecord,
        Vitals,
        Frame,
        Detections,
    ],
)
def test_each_field_is_recorded(kind: type) -> None:
    """By its name."""
    found = recorded(filled(kind))[0]
    assert lost(kind, found) == set()
    assert None not in found.values()


def test_what_is_inside_is_recorded() -> None:
    """Detections, setpoints, odometry, waypoints and commands, with each of their fields."""
    (found,) = recorded(filled(Detections))
    assert lost(Detection, found["items"][0]) == set()
    for kind in (PositionSetpoint, VelocitySetpoint):
        one = recorded(SetpointRecord(1, filled(kind), filled(kind)))[0]
        assert lost(kind, one["asked"]) == lost(kind, one["sent"]) == set()
    state = recorded(filled(VehicleState))[0]
    assert lost(Odometry, state["odometry"]) == lost(Odometry, state["truth"]) == set()
    given = [filled(Waypoint), filled(VelocityCommand)]
    navigation = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, given, priority=2)
    (found,) = recorded(navigation)
    assert lost(Waypoint, found["waypoints"][0]) == set()
    assert lost(VelocityCommand, found["commands"][0]) == set()
    assert found["priority"] == 2


def test_detections_and_cameras_are_read_as_they_were_recorded(tmp_path: Path) -> None:
    """By who shows and exports them: each field that is recorded at all."""
    path, found, frame = tmp_path / "flight.mcap", filled(Detections), filled(Frame)
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for seq, (stream, item) in enumerate((("drone/cam", frame), ("drone/finder", found))):
            recorder.write(Message(stream, seq, 6, HEADER, 0, (), item))
    with Recording.open(path) as recording:
        ((_, back),) = detections(recording, ["/drone/finder/detections"])
        values = {record.topic: record.value for record in recording.records()}
        (shot,) = shots(recording, ["/drone/cam/image"])
        depth = shot.depth()
    known = dataclasses.replace(found[0], appearance=None)
    assert (back.header, back.width, back.height) == (found.header, found.width, found.height)
    assert list(back) == [known]
    assert (shot.header, shot.odometry) == (frame.header, frame.odometry)
    np.testing.assert_array_equal(depth, frame.depth)
    camera = camera_of(values["/drone/cam/calibration"], values["/drone/cam/mount"])
    assert camera is not None
    for name in names(CameraModel):
        assert getattr(camera, name) == pytest.approx(getattr(frame.camera, name)), name


def test_a_body_of_which_no_joint_is_told_is_read_back() -> None:
    """JSON keeps no shape of what is empty."""
    found = filled(Detections)
    bare = dataclasses.replace(found[0], keypoints=np.zeros((0, 3), np.float32))
    (value,) = recorded(dataclasses.replace(found, items=(bare,)))
    (back,) = detections_of(value)
    assert back.keypoints is not None
    assert back.keypoints.size == 0
