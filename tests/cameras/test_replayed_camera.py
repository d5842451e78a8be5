"""A camera of a replayed flight: its pictures come when they came, with the stamps they had."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aerodaas.config.model import EnvironmentConfig, RecordingConfig, SensorConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.replay.mcap_camera import ReplayedCamera

ENVIRONMENT = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
MS = 1_000_000
STAMPS = (1234 * MS, 1334 * MS + 1, 1800 * MS)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Three pictures, at odd times of the mission; each was published 7 ms after its capture."""
    path = tmp_path / "a.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=Provenance(0)) as recorder:
        for number, stamp in enumerate(STAMPS):
            header = Header(number, stamp, "drone/cam")
            frame = Frame(header, np.full((24, 32, 3), 40 * number, np.uint8))
            recorder.write(Message("drone/cam", number, stamp + 7 * MS, header, 0, (), frame))
    return path


def camera(path: Path, **settings: object) -> ReplayedCamera:
    """An open camera."""
    sensor = SensorConfig(id="cam", driver="replayed", settings={"path": str(path), **settings})
    made = ReplayedCamera(sensor, ENVIRONMENT)
    made.open()
    return made


def test_pictures_come_at_their_recorded_mission_times(recording: Path) -> None:
    """The first not at once, each at its own nanosecond, and with that stamp however late asked."""
    source = camera(recording)
    asked = (0, STAMPS[0] - 1, STAMPS[0], STAMPS[1] - 1, STAMPS[1] + 9 * MS, STAMPS[2] + 80 * MS)
    found = [source.capture(stamp, None) for stamp in asked]
    stamps = [None if picture is None else picture.stamp for picture in found]
    assert stamps == [None, None, STAMPS[0], None, STAMPS[1], STAMPS[2]]
    shades = [round(float(picture.image.mean()) / 40) for picture in found if picture is not None]
    assert shades == [0, 1, 2]
    source.close()


@pytest.mark.parametrize("endless", [False, True])
def test_a_replay_does_not_begin_again(recording: Path, endless: bool) -> None:  # noqa: FBT001
    """It has finished after the last picture, unless the recorded camera never did."""
    source = camera(recording, loop=endless)
    last = source.capture(STAMPS[-1], None)
    assert last is not None
    assert last.stamp == STAMPS[-1]
    assert source.finished is not endless
    assert source.capture(10 * STAMPS[-1], None) is None
    source.close()
