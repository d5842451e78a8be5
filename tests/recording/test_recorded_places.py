"""What stands on the ground is placed in a recording as it was in flight, by its camera of then."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aerodaas.config.model import RecordingConfig
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.pictures import camera_of
from aerodaas.recording.playback.flight import read_flight
from aerodaas.recording.playback.page_items import packed_places
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder

SOURCE, FOUND = "drone/cam", "drone/people"
COUNT = 24


def camera(number: int) -> CameraModel:
    """On a gimbal that turns at every other frame, its lens zooming, and rolled."""
    turned = number // 2
    return CameraModel(
        *(320, 180, 300.0 + turned, 280.0 + turned, 161.0, 92.0),
        mount=(0.1, -0.05, 0.02),
        pitch=0.6 + 0.02 * turned,
        yaw=0.1 * turned - 0.5,
        roll=0.02 * turned - 0.1,
    )


def found(number: int) -> tuple[Frame, Detections]:
    """A frame with three people in it, one of them cut off by its lower edge."""
    header = Header(number, (1 + number) * 100_000_000, SOURCE)
    pose = Odometry(
        np.array([1.0 * number, -2.0, 12.0]), np.zeros(3), 0.3, -0.05, 0.1, position_sigma=0.7
    )
    frame = Frame(header, np.zeros((180, 320, 3), np.uint8), camera(number), pose)
    boxes = ((20.0, 30.0, 40.0, 90.0), (200.0, 90.0, 220.0, 160.0), (100.0, 90.0, 120.0, 179.0))
    return frame, Detections.of(frame, [Detection(box, "person", 0.9) for box in boxes])


def test_places_are_those_of_the_flight(tmp_path: Path) -> None:
    """To the millimetre, forwards and back, while gimbal and lens move."""
    path = tmp_path / "flight.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=Provenance()) as recorder:
        for number in range(COUNT):
            frame, people = found(number)
            header, later = frame.header, frame.header.stamp + 30_000_000
            recorder.write(Message(SOURCE, number, header.stamp, header, 0, (), frame))
            recorder.write(Message(FOUND, number, later, header, 0, (), people))
    with Recording.open(path) as recording:
        film = read_flight(recording)[1]
        for number in (*range(COUNT), 3, 20, 0):
            frame, people = found(number)
            (message, _), _ = film.at(SOURCE, frame.header.stamp)
            wanted = packed_places(people)["places"]
            assert wanted[2] is None
            assert wanted[0] is not None
            for place, told in zip(message["places"], wanted, strict=True):
                assert place == (told if told is None else pytest.approx(told, abs=2e-3))


def test_without_pose_or_camera_there_are_no_places(tmp_path: Path) -> None:
    """As in recordings whose camera is not calibrated."""
    path = tmp_path / "flight.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=Provenance()) as recorder:
        whole, people = found(0)
        frame = Frame(whole.header, whole.image, odometry=whole.odometry)
        recorder.write(Message(SOURCE, 0, frame.header.stamp, frame.header, 0, (), frame))
        recorder.write(Message(FOUND, 0, frame.header.stamp, frame.header, 0, (), people))
    with Recording.open(path) as recording:
        (message, _), _ = read_flight(recording)[1].at(SOURCE, frame.header.stamp)
        assert message["places"] == [None] * 3


def parts(**changes: Any) -> tuple[Any, Any]:  # noqa: ANN401 - of any type
    """Calibration and mount as they are recorded, some of it changed."""
    values: dict[str, Any] = {
        "K": [300.0, 0, 160, 0, 300, 90, 0, 0, 1],
        "width": 320,
        "height": 180,
        "x": 0.1,
        "w": 1.0,
        **changes,
    }
    place = SimpleNamespace(x=values["x"], y=0.0, z=0.0)
    turned = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=values["w"])
    calibration = SimpleNamespace(**{name: values[name] for name in ("K", "width", "height")})
    return calibration, SimpleNamespace(translation=place, rotation=turned)


@pytest.mark.parametrize(
    "changes",
    [
        {"K": []},
        {"K": [math.nan, 0, 160, 0, 300, 90, 0, 0, 1]},
        {"K": [-300.0, 0, 160, 0, 300, 90, 0, 0, 1]},
        {"K": [300.0, 0, 160, 0, 0.0, 90, 0, 0, 1]},
        {"width": 0},
        {"height": 2**31},
        {"x": math.inf},
        {"w": 0.0},
        {"w": 2.0},
    ],
)
def test_what_is_no_camera_is_none(changes: dict[str, Any]) -> None:
    """A stranger's recording may say anything."""
    assert camera_of(*parts()) is not None
    assert camera_of(*parts(**changes)) is None
