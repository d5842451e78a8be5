"""Video files play by the mission's stamps; live sources give their newest frame."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
import pytest

from aerodaas.cameras import live
from aerodaas.cameras.base import Camera
from aerodaas.cameras.live import LiveSource
from aerodaas.cameras.video import VideoCamera
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.config.secrets import SecretUrl
from aerodaas.types.clock import NANOSECONDS
from aerodaas.types.errors import ConfigError, SourceError

pytestmark = pytest.mark.wall_clock

ENVIRONMENT = EnvironmentConfig(robots=[RobotConfig(id="drone")])
STEP = 20
"""Grey levels between the frames of the test video."""


def camera(**settings: Any) -> VideoCamera:  # noqa: ANN401 - a sensor's settings are free
    """A camera that was not opened yet."""
    sensor = SensorConfig(id="cam", driver="video", rate=10, settings=settings)
    return VideoCamera(sensor, ENVIRONMENT)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten frames at 5 Hz that grow brighter."""
    path = tmp_path_factory.mktemp("video") / "ten.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 5, (64, 48))
    for number in range(10):
        writer.write(np.full((48, 64, 3), number * STEP, np.uint8))
    writer.release()
    return path


def number(image: np.ndarray[Any, np.dtype[np.uint8]]) -> int:
    """Which of the video's frames this is."""
    return round(float(image.mean()) / STEP)


def test_a_file_gives_the_frame_of_each_stamp(video: Path) -> None:
    """The video's own rate counts, not the sensor's; frames whose time has passed are left out."""
    source = camera(path=str(video))
    assert isinstance(source, Camera)
    source.open()
    assert source.model is not None
    assert (source.model.width, source.model.height) == (64, 48)
    seen = {}
    for tenth in (0, 1, 2, 3, 4, 10, 17, 18):
        picture = source.capture(NANOSECONDS + tenth * NANOSECONDS // 10, None)
        seen[tenth] = None if picture is None else number(picture.image)
    assert seen == {0: 0, 1: None, 2: 1, 3: None, 4: 2, 10: 5, 17: 8, 18: 9}
    before = source.finished
    assert source.capture(3 * NANOSECONDS, None) is None
    assert (before, source.finished) == (False, True)
    source.close()


def test_a_file_that_loops_begins_again(video: Path) -> None:
    """Frame 12 of ten frames is the third."""
    source = camera(path=str(video), loop=True)
    source.open()
    stamps = [0, 9 * NANOSECONDS // 5, 12 * NANOSECONDS // 5]
    pictures = [source.capture(stamp, None) for stamp in stamps]
    assert [number(picture.image) for picture in pictures if picture] == [0, 9, 2]
    assert not source.finished
    source.close()


def test_a_file_that_cannot_be_decoded_is_refused(tmp_path: Path) -> None:
    """Missing or foreign: the message names the file and the remedy."""
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(b"no video" * 100)
    for path in (broken, tmp_path / "gone.mp4"):
        with pytest.raises(SourceError, match=rf"{path.name}.*ffmpeg"):
            camera(path=str(path)).open()


def test_settings_are_checked() -> None:
    """A camera without a path cannot be."""
    with pytest.raises(ConfigError, match=r"sensor cam.*video file, URL or device"):
        camera()


class _Stream(BaseHTTPRequestHandler):
    """Motion JPEG, 50 frames a second, as many cameras serve it; hangs up after 30 frames."""

    level: ClassVar[int] = 0

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        for _ in range(30):
            type(self).level = (self.level + 1) % 250
            image = np.full((48, 64, 3), self.level, np.uint8)
            jpeg = cv2.imencode(".jpg", image)[1].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            try:
                self.wfile.write(head.encode() + jpeg + b"\r\n")
            except OSError:
                return
            time.sleep(0.02)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base's name
        pass


@pytest.fixture
def stream() -> Iterator[str]:
    """Address of a running stream."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Stream)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/stream.mjpg"
    server.shutdown()
    server.server_close()


def test_a_live_source_gives_each_newest_frame_once_and_reconnects(stream: str) -> None:
    """Frames carry the stamp of their capture, never run back, and outlive a hung-up source."""
    source = camera(path=stream)
    source.open()
    assert source.model is not None
    assert source.model.width == 64
    began = time.monotonic_ns()
    stamps: list[int] = []
    source_of = source._source
    assert isinstance(source_of, LiveSource)
    while source_of.reconnections < 1 or len(stamps) < 8:
        now = time.monotonic_ns() - began + NANOSECONDS
        picture = source.capture(now, None)
        if picture is not None:
            assert picture.stamp <= now
            stamps.append(picture.stamp)
        assert now < 40 * NANOSECONDS, (
            f"{len(stamps)} frames, {source_of.reconnections} reconnections"
        )
        time.sleep(0.05)
    assert stamps == sorted(set(stamps))
    assert not source.finished
    source.close()


def test_a_silent_address_is_refused_with_a_remedy() -> None:
    """Nobody answers: the user is told what to check."""
    source = LiveSource(SecretUrl("http://me:hidden@127.0.0.1:9/none?k=hidden"), timeout=0.5)
    with pytest.raises(
        SourceError, match=r"no picture from http://127.0.0.1:9/none\?\*\*\* within"
    ):
        source.open()


def test_a_stream_of_huge_pictures_is_refused(video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It may claim any size; what is larger than the largest is counted and not handed on."""
    fits = LiveSource(SecretUrl(str(video)))
    height, width, _ = fits.open().shape
    fits.close()
    monkeypatch.setattr(live, "_MOST_PIXELS", width * height - 1)
    source = LiveSource(SecretUrl(str(video)), timeout=1.0)
    with pytest.raises(SourceError, match="no picture from"):
        source.open()
    assert source.skipped >= 10
