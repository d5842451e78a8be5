"""A server of video that means harm costs its camera, and no memory beyond a bound."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import pytest

from aerodaas.cameras import live
from aerodaas.cameras.base import most_memory
from aerodaas.cameras.live import LiveSource
from aerodaas.cameras.video import VideoCamera
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.config.secrets import SecretUrl
from aerodaas.errors import SourceError

_MEMORY = 400 * 2**20
_SERVER = Path(__file__).with_name("hostile_rtsp.py")


@pytest.mark.slow
def test_no_server_takes_all_memory_or_keeps_its_reader() -> None:
    """Endless headers, descriptions, silences and frames, and huge pictures, all at once."""
    done = subprocess.run(
        [sys.executable, str(_SERVER), str(_MEMORY), "12"],
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    # One of them sends a whole picture first, which may be seen.
    assert found["errors"].pop("fragments") in {"", "SourceError"}
    assert set(found["errors"].values()) == {"SourceError"}
    assert found["bytes"] < 1.2 * _MEMORY


def _camera(path: str) -> VideoCamera:
    sensor = SensorConfig(id="cam", driver="video", rate=10, settings={"path": path})
    return VideoCamera(sensor, EnvironmentConfig(robots=[RobotConfig(id="drone")]))


def test_only_what_comes_from_elsewhere_is_bounded() -> None:
    """A network stream or a device, not a file of one's own."""
    assert most_memory(_camera("rtsp://cam/live")) == LiveSource.most_memory
    assert most_memory(_camera("film.mp4")) is None


class _Full:
    """A capture that finds no memory for its second frame."""

    asked = 0

    def grab(self) -> bool:
        return True

    def retrieve(self) -> tuple[bool, Any]:
        raise (cv2.error("no memory"), MemoryError())[type(self).asked % 2]

    def release(self) -> None:
        type(self).asked += 1


def test_a_frame_without_memory_is_skipped_and_asked_for_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The reading thread outlives it."""
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: _Full())
    monkeypatch.setattr(live, "_SHORTEST_WAIT", 0.001)
    monkeypatch.setattr(live, "_LONGEST_WAIT", 0.001)
    source = LiveSource(SecretUrl("/dev/video7"), timeout=1.0)
    with pytest.raises(SourceError, match="no picture from"):
        source.open()
    assert source.skipped > 1
    assert source.reconnections > 1
