"""Recordings as LeRobot datasets, read with what LeRobot reads them: pandas, pyarrow, PyAV."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet
from synthetic_flight import PROVENANCE, SyntheticFlight, record
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.extensions.exports.lerobot import ACTION, STATE, write_lerobot
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import SetpointRecord
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.recording.pictures import frames
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.recording.recorder import FlightRecorder

TASK = "survey the field"
CAMERA = "observation.images.camera"
MILLISECOND = 1_000_000


def table(folder: Path, name: str) -> list[dict[str, Any]]:
    """A table of the dataset, as a list of rows."""
    rows: list[dict[str, Any]] = parquet.read_table(folder / name).to_pylist()
    return rows


def filmed(path: Path) -> list[np.ndarray[Any, Any]]:
    """The video's frames, and that each is shown at its row's time."""
    images = []
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        for number, frame in enumerate(container.decode(stream)):
            assert frame.time == pytest.approx(number / 5, abs=1e-4)
            images.append(frame.to_ndarray(format="bgr24"))
    return images


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A flight's recording, and its dataset."""
    folder = tmp_path_factory.mktemp("flight")
    path = folder / "flight.mcap"
    record(path, SyntheticFlight(frames=5.0, rate=20.0, hover=0.5))
    with Recording.open(path) as recording:
        (written,) = write_lerobot(recording, folder, task=TASK)
    return path, written


def test_each_row_is_the_newest_state_and_picture(dataset: tuple[Path, Path]) -> None:
    """At the camera's rate; the state's figures are those recorded; a frame for each row."""
    path, folder = dataset
    rows = table(folder, "data/chunk-000/file-000.parquet")
    with Recording.open(path) as recording:
        pictures = list(frames(recording))
        states = [state for _, state in vehicle_states(recording, "tello")]
    begin = max(pictures[0].header.stamp, states[0].stamp)
    for number in (0, 7, len(rows) - 1):
        row, at = rows[number], begin + number * 200 * MILLISECOND
        newest = [state for state in states if state.stamp <= at][-1].odometry
        expected = [*newest.position, *newest.velocity]
        assert row["observation.state"][:6] == pytest.approx(expected, abs=1e-5)
        x, y, z, w = row["observation.state"][6:]
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        angles = (newest.roll, newest.pitch, newest.yaw)
        assert (roll, math.asin(2 * (w * y - z * x)), yaw) == pytest.approx(angles, abs=1e-5)
        assert row["timestamp"] == pytest.approx(number / 5)
        assert (row["frame_index"], row["index"]) == (number, number)
        assert (row["episode_index"], row["task_index"]) == (0, 0)
    images = filmed(folder / f"videos/{CAMERA}/chunk-000/file-000.mp4")
    assert len(images) == len(rows)
    for number in (0, 7, len(rows) - 1):
        at = begin + number * 200 * MILLISECOND
        shown = [picture for picture in pictures if picture.header.stamp <= at][-1].image
        assert np.abs(images[number].astype(int) - shown).mean() < 6


def test_the_tables_agree(dataset: tuple[Path, Path]) -> None:
    """Counts, features and statistics; pandas finds the task as the index."""
    _, folder = dataset
    info = json.loads((folder / "meta/info.json").read_text(encoding="utf-8"))
    stats = json.loads((folder / "meta/stats.json").read_text(encoding="utf-8"))
    rows = table(folder, "data/chunk-000/file-000.parquet")
    (episode,) = table(folder, "meta/episodes/chunk-000/file-000.parquet")
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 5, 1)
    assert info["total_frames"] == episode["length"] == episode["dataset_to_index"] == len(rows)
    assert episode["tasks"] == [TASK]
    assert episode[f"videos/{CAMERA}/to_timestamp"] == pytest.approx(len(rows) / 5)
    assert info["features"][CAMERA]["shape"] == [180, 320, 3]
    assert set(rows[0]) == set(info["features"]) - {CAMERA}
    for name, names in (("observation.state", STATE), ("action", ACTION)):
        values = np.array([row[name] for row in rows])
        assert info["features"][name]["names"] == list(names)
        assert info["features"][name]["shape"] == [values.shape[1]] == [len(names)]
        assert stats[name]["mean"] == pytest.approx(values.mean(axis=0), abs=1e-5)
        assert stats[name]["max"] == episode[f"stats/{name}/max"]
    assert np.shape(stats[CAMERA]["mean"]) == (3, 1, 1)
    assert 0 <= np.min(stats[CAMERA]["min"]) <= np.max(stats[CAMERA]["max"]) <= 1
    tasks = pd.read_parquet(folder / "meta/tasks.parquet")
    assert tasks.loc[TASK].task_index == 0


def flown(path: Path, sent: dict[int, Setpoint | None], *, small: bool = False) -> None:
    """Record 2 s at 10 Hz at (1, 2, 3); setpoints by millisecond, all asked for as 9 m/s."""
    asked = VelocitySetpoint(np.array([9.0, 9.0, 9.0]), 9.0)
    lens = CameraModel.from_fov(64, 48, 1.4)
    pose = Odometry(np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.0, 0.0]), 0.0)
    messages: list[tuple[str, int, Any]] = []
    for milli in range(0, 2001, 50):
        stamp = milli * MILLISECOND
        if milli in sent:
            messages.append(("a", stamp, SetpointRecord(stamp, asked, sent[milli])))
        if milli % 100 == 0:
            state = VehicleState(stamp, pose, Battery(1.0), VehicleMode.GUIDED, armed=True)
            messages.append(("a", stamp, state))
            half = 2 if small and milli >= 1000 else 1
            image = np.full((48 // half, 64 // half, 3), milli // 10, np.uint8)
            messages.append(("a/cam", stamp, Frame(Header(milli, stamp, "a/cam"), image, lens)))
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for number, (stream, stamp, item) in enumerate(messages):
            header = item.header if isinstance(item, Frame) else Header(number, stamp, stream)
            recorder.write(Message(stream, number, stamp, header, stamp, (), item))


def test_actions_are_what_was_sent(tmp_path: Path) -> None:
    """Not what was asked; the way to a place as a velocity; nothing after a second of silence."""
    path = tmp_path / "flight.mcap"
    place = PositionSetpoint(np.array([1.0, 2.0, 23.0]), 0.0, 2.0)
    flown(
        path,
        {
            200: VelocitySetpoint(np.array([1.0, 0.0, -0.5]), 0.25),
            400: place,
            500: PositionSetpoint(np.array([1.0, 2.0, 23.0])),
            600: None,
            700: VelocitySetpoint(np.array([0.0, 1.0, 0.0]), 0.0),
        },
    )
    with Recording.open(path) as recording:
        (folder,) = write_lerobot(recording, tmp_path, task=TASK)
    actions = [row["action"] for row in table(folder, "data/chunk-000/file-000.parquet")]
    assert len(actions) == 21
    assert actions[0] == [0, 0, 0, 0]
    assert actions[2] == actions[3] == [1.0, 0.0, -0.5, 0.25]
    assert (actions[4], actions[5]) == ([0, 0, 2.0, 0], [0, 0, 0.5, 0])
    assert actions[6] == [0, 0, 0, 0]
    assert actions[7] == actions[16] == [0, 1, 0, 0]
    assert actions[17] == [0, 0, 0, 0]


def test_rows_keep_to_the_clock_of_thirty_pictures_a_second(tmp_path: Path) -> None:
    """Each picture is shown, in the row of its own time; the video's times agree with the rows'."""
    path, count = tmp_path / "flight.mcap", 240
    lens = CameraModel.from_fov(64, 48, 1.4)
    pose = Odometry(np.array([1.0, 2.0, 3.0]), np.zeros(3), 0.0)
    begin = 7_000_000
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for number in range(count):
            # Truncated or rounded to a nanosecond, as cameras' stamps are.
            stamp = begin + (number * 1_000_000_000 + (29 if number % 2 else 0)) // 30
            state = VehicleState(stamp, pose, Battery(1.0), VehicleMode.GUIDED, armed=True)
            image = np.full((48, 64, 3), number % 16 * 16, np.uint8)
            header = Header(number, stamp, "a/cam")
            for stream, item in (("a", state), ("a/cam", Frame(header, image, lens))):
                recorder.write(Message(stream, number, stamp, header, stamp, (), item))
    with Recording.open(path) as recording:
        (folder,) = write_lerobot(recording, tmp_path, task=TASK)
    rows = table(folder, "data/chunk-000/file-000.parquet")
    assert len(rows) == count
    video = folder / "videos/observation.images.cam/chunk-000/file-000.mp4"
    with av.open(str(video)) as container:
        shown = list(container.decode(video=0))
    assert len(shown) == count
    for row, picture in zip(rows, shown, strict=True):
        # LeRobot's own tolerance between a row's time and its picture's.
        assert picture.time == pytest.approx(row["timestamp"], abs=1e-4)
        level = row["index"] % 16 * 16
        assert picture.to_ndarray(format="gray").mean() == pytest.approx(level, abs=6)


def test_a_camera_that_becomes_smaller_keeps_its_video(tmp_path: Path) -> None:
    """Its pictures are scaled; there is a frame for each row."""
    path = tmp_path / "flight.mcap"
    flown(path, {}, small=True)
    with Recording.open(path) as recording:
        (folder,) = write_lerobot(recording, tmp_path, task=TASK)
    capture = cv2.VideoCapture(str(folder / "videos/observation.images.cam/chunk-000/file-000.mp4"))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == 21


def test_what_makes_no_dataset_is_told(tmp_path: Path, dataset: tuple[Path, Path]) -> None:
    """No pictures, no task, a folder that is there; by the command, too."""
    path = tmp_path / "blind.mcap"
    record(path, SyntheticFlight(rate=5.0, hover=0.5))
    with (
        Recording.open(path) as recording,
        pytest.raises(RecordingError, match="two pictures or more"),
    ):
        write_lerobot(recording, tmp_path, task=TASK)
    for words, told in (("", "needs its task"), (TASK, "already exists")):
        outcome = CliRunner().invoke(app, ["export", "lerobot", str(dataset[0]), words])
        assert isinstance(outcome.exception, RecordingError)
        assert told in str(outcome.exception)
