"""A whole flight's file, message by message, by tools that nobody here wrote."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any, ClassVar

import foxglove.messages
import jsonschema
import numpy as np
import pytest
from flying import FLAT, Flyer, hop, robot
from google.protobuf.unknown_fields import UnknownFieldSet
from mcap.reader import NonSeekingReader
from mcap_protobuf.decoder import DecoderFactory

from aerodaas import Analytics, Detections, Environment, Frame
from aerodaas.analytics.base import Context
from aerodaas.messages.detections import Detection

SENSORS = [
    {"id": "cam", "type": "camera", "rate": 10, "settings": {"width": 64, "height": 36}},
    {"id": "odom", "type": "odometry", "rate": 10},
    {"id": "gps", "type": "gps", "rate": 5},
    {"id": "cell", "type": "battery", "rate": 2},
]
HOME = {"latitude": 12.97, "longitude": 77.59, "altitude": 900}


class Centre(Analytics[Detections]):
    """Finds something in the middle of every other picture."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections

    def process(self, item: Frame, context: Context) -> Detections:  # noqa: ARG002
        """One box with a keypoint, or nothing."""
        points = np.array([[32, 18, 0.9]], np.float32)
        found = [Detection((24.0, 12.0, 40.0, 24.0), "thing", 0.5, 1, points)]
        return Detections.of(item, found if item.header.id % 2 else [])


def build(env: Environment) -> None:
    """Two waypoints, a camera with a detector, every sensor."""
    drone = env.get_robot_by_id("drone")
    Centre().analyse(drone.get_sensor_by_id("cam").get_data_stream())
    drone.navigate(hop((2, 0), (2, 2)))


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of a flight with all that is recorded."""
    flyer = Flyer(tmp_path_factory.mktemp("flown"))
    fence = {"polygon": [[-5, -5], [9, -5], [9, 9], [-5, 9]]}
    drone = robot(sensors=SENSORS)
    content = {
        **FLAT,
        "home": HOME,
        "robots": [{**drone, "limits": {**drone["limits"], "geofence": fence}}],
        "recording": {"images": "h264"},
    }
    run = flyer.fly(build, content)
    assert run.recording is not None
    return run.recording


def messages(path: Path) -> list[tuple[str, str, Any, Any]]:
    """Topic, schema's name, message and value of everything, each validated by its own schema."""
    decoders = DecoderFactory()
    checks: dict[str, Any] = {}
    found = []
    with path.open("rb") as file:
        everything = NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False)
        for schema, channel, message in everything:
            assert schema is not None, channel.topic
            if channel.message_encoding == "json":
                if schema.name not in checks:
                    described = json.loads(schema.data)
                    jsonschema.Draft202012Validator.check_schema(described)
                    checks[schema.name] = jsonschema.Draft202012Validator(described)
                value = json.loads(message.data)
                checks[schema.name].validate(value)
            else:
                decode = decoders.decoder_for(channel.message_encoding, schema)
                assert decode is not None, channel.topic
                value = decode(message.data)
                # Nothing that the schema does not know.
                assert len(UnknownFieldSet(value)) == 0
                assert value.ByteSize() == len(message.data)
            found.append((channel.topic, schema.name, message, value))
    return found


@pytest.mark.slow
def test_every_message_is_valid(flown: Path) -> None:
    """Each by the schema that the file carries for it, Foxglove's being Foxglove's own."""
    found = messages(flown)
    kinds = {kind for _, kind, _, _ in found}
    assert kinds >= {
        "foxglove.CompressedVideo", "foxglove.CameraCalibration", "foxglove.FrameTransform",
        "foxglove.ImageAnnotations", "foxglove.Odometry", "foxglove.LocationFix",
        "foxglove.SceneUpdate", "foxglove.PosesInFrame", "foxglove.GeoJSON", "foxglove.Log",
        "aerodaas.VehicleState", "aerodaas.MissionStatus", "aerodaas.Setpoint", "aerodaas.Battery",
        "aerodaas.Detections", "aerodaas.Latency", "aerodaas.Vitals", "aerodaas.Geofence",
    }  # fmt: skip
    for kind in kinds:
        if kind.startswith("foxglove."):
            name = kind.removeprefix("foxglove.").replace("GeoJSON", "GeoJson")
            assert hasattr(foxglove.messages, name)
    for topic, _, message, _ in found:
        assert message.publish_time <= message.log_time, topic


@pytest.mark.slow
def test_frames_of_reference_form_one_tree(flown: Path) -> None:
    """Every frame that a message names hangs, by one parent each, from the map."""
    found = messages(flown)
    parents: dict[str, set[str]] = defaultdict(set)
    named = set()
    for _, kind, _, value in found:
        if kind == "foxglove.FrameTransform":
            parents[value.child_frame_id].add(value.parent_frame_id)
            rotation = value.rotation
            length = rotation.x**2 + rotation.y**2 + rotation.z**2 + rotation.w**2
            assert length == pytest.approx(1.0)
        elif hasattr(value, "frame_id"):
            named.add(value.frame_id)
    assert parents == {"drone/base_link": {"map"}, "drone/cam": {"drone/base_link"}}
    assert named <= {"map", *parents}
    assert "drone/cam" in named


@pytest.mark.slow
def test_boxes_lie_over_their_pictures(flown: Path) -> None:
    """Each annotation has the very timestamp of a picture, and lies within it."""
    found = messages(flown)
    pictures = {
        value.timestamp.ToNanoseconds(): message
        for _, kind, message, value in found
        if kind == "foxglove.CompressedVideo"
    }
    notes = [(m, value) for _, kind, m, value in found if kind == "foxglove.ImageAnnotations"]
    assert len(notes) > 10
    for message, value in notes:
        assert value.timestamp.ToNanoseconds() in pictures
        assert message.publish_time == pictures[value.timestamp.ToNanoseconds()].publish_time
        for shape in value.points:
            assert shape.timestamp == value.points[0].timestamp
            assert all(0 <= point.x <= 64 and 0 <= point.y <= 36 for point in shape.points)
    calibrations = [value for _, kind, _, value in found if kind == "foxglove.CameraCalibration"]
    assert [(one.frame_id, one.width, one.height) for one in calibrations] == [
        ("drone/cam", 64, 36)
    ]
