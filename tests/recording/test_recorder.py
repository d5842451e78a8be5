"""What goes into a recorder comes out of the file, as read by the mcap library itself."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory
from synthetic_flight import CAMERA, FENCE, HOME, PROVENANCE, SyntheticFlight, record

from aerodaas.config.model import RecordingConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import RecordingError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import Decision, MissionState, MissionStatus, SetpointRecord
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.messages.waypoints import VelocityCommand, Waypoint
from aerodaas.recording.pictures import detections, frames
from aerodaas.recording.reader import Record, Recording
from aerodaas.recording.recorder import FlightRecorder

HEADER = Header(41, 2_000_000_000, "tello/camera")
ODOMETRY = Odometry(
    np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.5, 0.1]), np.pi / 2, 0.1, -0.2, 0.3, 0.05
)


def recorded(path: Path, *items: object, **settings: str) -> dict[str, list[Record]]:
    """Write items of one stream and read everything back, by topic."""
    with FlightRecorder(
        path,
        config=RecordingConfig.model_validate(settings),
        provenance=PROVENANCE,
        home=HOME,
        fences={"tello": FENCE},
    ) as recorder:
        for seq, item in enumerate(items):
            stamp = 2_100_000_000 + seq
            recorder.write(Message("tello/it", seq, stamp, HEADER, 0, (), item))
    found: dict[str, list[Record]] = {}
    with Recording.open(path) as recording:
        for record_ in recording.records():
            found.setdefault(record_.topic, []).append(record_)
    return found


def test_whole_flight_reads_strictly(tmp_path: Path) -> None:
    """Every checksum holds, every message decodes by the schema that the file itself carries."""
    path = tmp_path / "flight.mcap"
    summary = record(path, SyntheticFlight(rate=4, frames=1), drops=3)
    with path.open("rb") as file:
        strict = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        described = strict.get_summary()
        assert described is not None
        assert described.statistics is not None
        assert described.statistics.message_count == summary.messages
        topics = {
            channel.topic: described.schemas[channel.schema_id].name
            for channel in described.channels.values()
        }
    with path.open("rb") as file:
        count = 0
        decoders = DecoderFactory()
        checks: dict[str, Any] = {}
        for schema, channel, message in NonSeekingReader(file, validate_crcs=True).iter_messages(
            log_time_order=False
        ):
            assert schema is not None
            count += 1
            if channel.message_encoding == "json":
                check = checks.setdefault(
                    schema.name, jsonschema.Draft202012Validator(json.loads(schema.data))
                )
                check.validate(json.loads(message.data))
            else:
                decode = decoders.decoder_for(channel.message_encoding, schema)
                assert decode is not None
                assert decode(message.data).ByteSize() == len(message.data)
    assert count == summary.messages
    assert topics == {
        "/alerts": "aerodaas.Alert",
        "/drops": "aerodaas.Drops",
        "/latency": "aerodaas.Latency",
        "/log": "foxglove.Log",
        "/tello/camera/calibration": "foxglove.CameraCalibration",
        "/tello/camera/frame": "aerodaas.Frame",
        "/tello/camera/image": "foxglove.CompressedImage",
        "/tello/camera/mount": "foxglove.FrameTransform",
        "/tello/detector/boxes": "foxglove.ImageAnnotations",
        "/tello/detector/detections": "aerodaas.Detections",
        "/tello/dispatcher/decision": "aerodaas.Decision",
        "/tello/fence": "aerodaas.Geofence",
        "/tello/fence/map": "foxglove.GeoJSON",
        "/tello/fence/scene": "foxglove.SceneUpdate",
        "/tello/follow/navigation": "aerodaas.Navigation",
        "/tello/mission": "aerodaas.MissionStatus",
        "/tello/mission/map": "foxglove.GeoJSON",
        "/tello/mission/path": "foxglove.PosesInFrame",
        "/tello/mission/plan": "aerodaas.Plan",
        "/tello/mission/scene": "foxglove.SceneUpdate",
        "/tello/setpoints/setpoint": "aerodaas.Setpoint",
        "/tello/state": "aerodaas.VehicleState",
        "/tello/state/location": "foxglove.LocationFix",
        "/tello/state/odometry": "foxglove.Odometry",
        "/tello/state/transform": "foxglove.FrameTransform",
    }


def test_same_flight_gives_the_same_records(tmp_path: Path) -> None:
    """Nothing of the host's clock or the order of threads gets into the messages."""
    contents = []
    for name in ("a.mcap", "b.mcap"):
        record(tmp_path / name, SyntheticFlight(seed=3, rate=4, frames=1))
        with (tmp_path / name).open("rb") as file:
            contents.append(
                [
                    (channel.topic, message.log_time, message.publish_time, message.data)
                    for _, channel, message in make_reader(file).iter_messages()
                ]
            )
    assert contents[0] == contents[1]


def test_frame_with_camera(tmp_path: Path) -> None:
    """The picture survives as a JPEG does; the camera is written once until it changes."""
    image = np.zeros((180, 320, 3), np.uint8)
    image[:, 160:] = (0, 200, 100)
    frame = Frame(HEADER, image, CAMERA, ODOMETRY)
    path = tmp_path / "frame.mcap"
    found = recorded(path, frame, frame)
    assert len(found["/tello/it/image"]) == 2
    (calibration,) = found["/tello/it/calibration"]
    assert list(calibration.value.K) == [CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1]
    (mount,) = found["/tello/it/mount"]
    assert (mount.value.parent_frame_id, mount.value.child_frame_id) == (
        "tello/base_link",
        "tello/camera",
    )
    picture = found["/tello/it/image"][0].value
    assert picture.frame_id == calibration.value.frame_id
    with Recording.open(path) as recording:
        back = next(iter(frames(recording)))
    assert back.header == HEADER
    assert np.abs(back.image.astype(int) - image).mean() < 2
    assert back.odometry is not None
    assert np.array_equal(back.odometry.position, ODOMETRY.position)
    assert back.odometry.yaw == ODOMETRY.yaw


def test_images_can_be_left_out(tmp_path: Path) -> None:
    """`images: none` keeps the frames' times and numbers only."""
    frame = Frame(HEADER, np.zeros((18, 32, 3), np.uint8))
    found = recorded(tmp_path / "no.mcap", frame, images="none")
    assert "/tello/it/image" not in found
    assert found["/tello/it/frame"][0].value.header == HEADER


def test_detections_come_back_exactly(tmp_path: Path) -> None:
    """Boxes are drawn at the picture's own time, and the figures lose nothing."""
    keypoints = np.array([[1.5, 2.5, 0.9], [3.0, 4.0, 0.1]], np.float32)
    item = Detections(
        HEADER,
        (
            Detection((1.25, 2.0, 30.0, 40.0), "person", 0.875, 7, keypoints),
            Detection((0.0, 0.0, 5.0, 5.0), "dog", 0.5),
        ),
        320,
        180,
    )
    path = tmp_path / "boxes.mcap"
    found = recorded(path, item)
    annotations = found["/tello/it/boxes"][0].value
    assert annotations.timestamp.ToNanoseconds() == PROVENANCE.started_ns + HEADER.stamp
    loop, points, _ = annotations.points
    assert [(p.x, p.y) for p in loop.points] == [(1.25, 2), (30, 2), (30, 40), (1.25, 40)]
    assert [(p.x, p.y) for p in points.points] == [(1.5, 2.5)]
    assert [text.text for text in annotations.texts] == ["person #7 0.88", "dog 0.50"]
    with Recording.open(path) as recording:
        ((_, back),) = detections(recording)
    assert back.items[1] == item.items[1]
    assert back.items[0].box == item.items[0].box
    assert back.items[0].keypoints is not None
    assert np.array_equal(back.items[0].keypoints, keypoints)


def test_velocities_are_those_of_a_body_that_leans(tmp_path: Path) -> None:
    """Turned back by the recorded attitude they are the local frame's again, roll and pitch too."""
    leaning = Odometry(np.array([1.0, 2.0, 3.0]), np.array([0.5, -1.0, 0.25]), 2.0, 0.3, -0.2, 0.4)
    pose = recorded(tmp_path / "lean.mcap", leaning)["/tello/it/odometry"][0].value
    at = pose.pose.orientation
    axis = np.array([at.x, at.y, at.z])

    def turned(one: Any) -> np.ndarray[Any, Any]:  # noqa: ANN401 - a protobuf vector
        inner = np.array([one.x, one.y, one.z])
        # Rotation by a unit quaternion: v + 2w (q x v) + 2 q x (q x v).
        cross = np.cross(axis, inner)
        return np.asarray(inner + 2.0 * at.w * cross + 2.0 * np.cross(axis, cross))

    assert turned(pose.linear_velocity) == pytest.approx(leaning.velocity)
    assert turned(pose.angular_velocity) == pytest.approx([0.0, 0.0, leaning.yaw_rate])


def test_vehicle_state(tmp_path: Path) -> None:
    """Odometry has its velocity in the body's frame, GPS goes to the map, the rest is JSON."""
    state = VehicleState(
        1_900_000_000,
        ODOMETRY,
        Battery(0.5, 7.4, 3.0),
        VehicleMode.GUIDED,
        armed=True,
        gps=GpsFix(12.0, 77.0, 900.0, 1.5, 3.0, 9),
        faults=("compass",),
    )
    found = recorded(tmp_path / "state.mcap", state)
    pose = found["/tello/it/odometry"][0]
    assert pose.captured == state.stamp
    assert (pose.value.pose.position.x, pose.value.pose.position.z) == (1, 3)
    # Flying north with the nose to the north: forward, but for the lean.
    assert pose.value.linear_velocity.x == pytest.approx(0.5, abs=0.05)
    assert pose.value.linear_velocity.y == pytest.approx(0.0, abs=0.05)
    location = found["/tello/it/location"][0].value
    assert list(location.position_covariance)[::4] == [2.25, 2.25, 9.0]
    value = found["/tello/it/state"][0].value
    assert value == state


def test_single_readings(tmp_path: Path) -> None:
    """Odometry, GPS and battery sensors have their channels too."""
    found = recorded(tmp_path / "readings.mcap", ODOMETRY, GpsFix(1.0, 2.0, 3.0), Battery(0.25))
    assert found["/tello/it/transform"][0].value.child_frame_id == "tello/base_link"
    assert found["/tello/it/location"][0].value.longitude == 2.0
    assert found["/tello/it/battery"][0].value == Battery(0.25)


def test_plan_is_written_when_it_changes(tmp_path: Path) -> None:
    """Reaching waypoints is no new plan; an inserted one is."""
    a, b, c = (Waypoint(name, 1.0, float(i), 1.5) for i, name in enumerate("abc"))

    def status(target: Waypoint | None, *pending: Waypoint) -> MissionStatus:
        return MissionStatus(1, MissionState.ENROUTE, "", target, pending)

    found = recorded(
        tmp_path / "plan.mcap",
        status(a, b),
        status(a, b),
        status(b),
        status(c, b),
        status(b),
        status(None),
    )
    plans = [[w.id for w in it.value.waypoints] for it in found["/tello/it/plan"]]
    assert plans == [["a", "b"], ["c", "b"]]
    scene = found["/tello/it/scene"]
    assert [entity.id for it in scene for entity in it.value.entities] == ["tello/plan"] * 2
    first = json.loads(found["/tello/it/map"][0].value.geojson)["features"][0]
    longitude, latitude, _ = first["geometry"]["coordinates"][0]
    assert (longitude, latitude) == (
        pytest.approx(HOME.longitude, abs=1e-4),
        pytest.approx(HOME.latitude, abs=1e-4),
    )


def test_changes_of_state_and_faults_are_logged_once(tmp_path: Path) -> None:
    """The log reads as the story of the flight."""
    items = [
        MissionStatus(stamp, state, "why", faults=faults)
        for stamp, (state, faults) in enumerate(
            [
                (MissionState.ENROUTE, ()),
                (MissionState.ENROUTE, ("link weak",)),
                (MissionState.ENROUTE, ("link weak",)),
                (MissionState.LANDING, ()),
            ]
        )
    ]
    found = recorded(tmp_path / "story.mcap", *items)
    lines = [(record.value.level, record.value.message) for record in found["/log"]]
    assert lines == [(2, "enroute: why"), (3, "link weak"), (2, "landing: why")]


def test_setpoints_decisions_navigation_alerts(tmp_path: Path) -> None:
    """What was decided is there with its reasons."""
    setpoint = SetpointRecord(
        5,
        PositionSetpoint(np.array([1.0, 2.0, 3.0]), speed=2.0),
        VelocitySetpoint(np.array([0.5, 0.0, 0.0]), 0.1),
        ("max_speed",),
        HEADER,
    )
    decision = Decision(6, "detector#4", "cloud", "edge is late", {"slack": 0.25})
    place, command = Waypoint("a", 1.0, 2.0, 3.0), VelocityCommand(forward=0.5)
    alert = Alert(HEADER, "battery_low", "at 20 %", {"fraction": float("nan"), "who": object()})
    found = recorded(
        tmp_path / "decided.mcap",
        setpoint,
        decision,
        AeroNavigation(data=[place, command]),
        alert,
    )
    assert found["/tello/it/setpoint"][0].value == setpoint
    assert found["/tello/it/setpoint"][0].labels.robot == "tello"
    assert found["/tello/it/decision"][0].value == decision
    navigation = found["/tello/it/navigation"][0].value
    assert navigation.header == HEADER
    assert (navigation.waypoints, navigation.commands) == ((place,), (command,))
    assert found["/alerts"][0].value.values == {"fraction": None, "who": "<object>"}
    assert found["/log"][-1].value.message == "battery_low: at 20 %"


def test_texts_and_log_records(tmp_path: Path) -> None:
    """Python's levels become Foxglove's."""
    line = logging.LogRecord("nav", logging.ERROR, "/x/nav.py", 12, "lost %s", ("it",), None)
    log = recorded(tmp_path / "log.mcap", "hello", line)["/log"]
    assert [(it.value.level, it.value.message) for it in log] == [(2, "hello"), (4, "lost it")]


def test_anything_else_becomes_json(tmp_path: Path) -> None:
    """A plug-in's own type needs no converter."""
    found = recorded(tmp_path / "any.mcap", {"a": np.float32(0.5), "b": object()}, 17)
    first, second = (record.value for record in found["/tello/it/value"])
    assert (first.type, first.value) == ("dict", {"a": 0.5, "b": "<object>"})
    assert second.value == 17


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    """A file that is there stays as it is."""
    path = tmp_path / "there.mcap"
    path.write_text("mine")
    with pytest.raises(RecordingError, match=r"there\.mcap already exists"):
        FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE)
    assert path.read_text() == "mine"
