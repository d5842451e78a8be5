"""Video files play by the mission's stamps; live sources give their newest frame."""

from __future__ import annotations

import itertools
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from fractions import Fraction
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar

import av
import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.cameras import live
from aerodaas.cameras.base import Camera
from aerodaas.cameras.live import LiveSource
from aerodaas.cameras.video import VideoCamera
from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.config.secrets import SecretUrl
from aerodaas.errors import ConfigError, SourceError

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


def test_a_damaged_file_is_told_by_us_alone(tmp_path: Path) -> None:
    """FFmpeg has a line of its own for each thing that it stumbles over."""
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(bytes(4) + b"ftypisom" + bytes(4000))
    code = (
        "from aerodaas.cameras.video_file import VideoFile\n"
        "from aerodaas.config.secrets import SecretUrl\n"
        "from aerodaas.errors import SourceError\n"
        f"try: VideoFile(SecretUrl({str(broken)!r}), 5.0, loop=False).open()\n"
        "except SourceError: print('told')"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert (ended.stdout, ended.stderr) == ("told\n", "")


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


def encode(path: Path, stamps: list[int], rate: int = 30, clock: int = 1000) -> Path:
    """A video whose frames grow brighter, each at its own stamp in ticks of 1/`clock` s."""
    with av.open(str(path), "w", options={"video_track_timescale": str(clock)}) as container:
        stream: Any = container.add_stream("libx264", rate=rate)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = stream.time_base = Fraction(1, clock)
        stream.codec_context.max_b_frames = 0
        for number, stamp in enumerate(stamps):
            grey = np.full((48, 64, 3), number * STEP, np.uint8)
            frame = av.VideoFrame.from_ndarray(grey, format="bgr24")
            frame.pts, frame.time_base = stamp, Fraction(1, clock)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def played(source: VideoCamera, until: float, rate: float = 10.0) -> dict[int, float]:
    """When each frame is shown first, seconds."""
    source.open()
    shown: dict[int, float] = {}
    for tick in range(round(until * rate) + 1):
        picture = source.capture(NANOSECONDS + round(tick * NANOSECONDS / rate), None)
        if picture is not None:
            shown.setdefault(number(picture.image), tick / rate)
    source.close()
    return shown


def test_a_file_of_variable_rate_plays_by_its_frames_own_stamps(tmp_path: Path) -> None:
    """Quick frames, slow frames, and a pause of a minute."""
    stamps = [0, 100, 200, 1200, 2200, 3200, 63_200, 63_300, 63_400]
    source = camera(path=str(encode(tmp_path / "variable.mp4", stamps)))
    assert played(source, 65.0) == {index: stamp / 1000 for index, stamp in enumerate(stamps)}
    assert source.finished


def test_a_file_that_begins_late_begins_at_once(tmp_path: Path) -> None:
    """Its first stamp is the beginning."""
    source = camera(path=str(encode(tmp_path / "late.mkv", [5000, 5100, 5400])))
    assert played(source, 1.0) == {0: 0.0, 1: 0.1, 2: 0.4}


def test_a_header_of_too_high_a_rate_does_not_hide_frames(tmp_path: Path) -> None:
    """30,000 Hz is the clock's: frames play by their stamps, or at the sensor's rate without."""
    stamps = [3000 * index for index in range(10)]
    path = encode(tmp_path / "ticks.mp4", stamps, 30_000, 30_000)
    assert played(camera(path=str(path)), 1.0) == {index: index / 10 for index in range(10)}
    path = encode(tmp_path / "ticks.avi", [*range(10)], 30_000, 30_000)
    assert played(camera(path=str(path)), 1.0) == {index: index / 10 for index in range(10)}


@given(
    st.lists(st.integers(3, 3000), min_size=1, max_size=11),
    st.lists(st.integers(1, 2000), min_size=1, max_size=30),
)
@settings(max_examples=30, deadline=None)
def test_the_frame_shown_is_the_newest_that_is_due(
    tmp_path_factory: pytest.TempPathFactory, gaps: list[int], steps: list[int]
) -> None:
    """Whatever the stamps, and whenever it is asked for."""
    stamps = [0, *itertools.accumulate(gaps)]
    path = encode(tmp_path_factory.mktemp("video") / "any.mp4", stamps)
    source = camera(path=str(path))
    source.open()
    shown = -1
    for now in [0, *itertools.accumulate(steps)]:
        due = max(index for index, stamp in enumerate(stamps) if stamp <= now)
        picture = source.capture(NANOSECONDS + now * 1_000_000, None)
        assert (None if picture is None else number(picture.image)) == (
            due if due > shown else None
        )
        shown = due
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
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
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
