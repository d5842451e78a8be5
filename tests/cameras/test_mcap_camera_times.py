"""When a recording's pictures are due, which are passed over, and what is told of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from foxglove.messages import CompressedImage
from mcap.writer import Writer

from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, RecordingConfig, SensorConfig
from aerodaas.errors import ConfigError, SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.replay.mcap_camera import McapCamera

ENVIRONMENT = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
SECOND = 1_000_000_000
BEGIN = 70 * SECOND
"""Mission time at which the first picture is asked for."""


def jpeg(number: int, width: int = 32) -> bytes:
    """A picture that tells its number by its brightness."""
    image = np.full((24, width, 3), 20 * number, np.uint8)
    return cv2.imencode(".jpg", image)[1].tobytes()


def write(path: Path, *pictures: tuple[float, bytes], topic: str = "/cam") -> Path:
    """Record pictures, each taken at a second, one after the other."""
    timed = [
        (5 * SECOND + number, 5 * SECOND + round(second * SECOND), data)
        for number, (second, data) in enumerate(pictures)
    ]
    return write_at(path, timed, topic)


def write_at(path: Path, timed: Sequence[tuple[int, int, bytes]], topic: str = "/cam") -> Path:
    """Record pictures with their times of recording and capture, nanoseconds."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        described = CompressedImage.get_schema()
        schema = writer.register_schema(described.name, described.encoding, described.data)
        channel = writer.register_channel(topic, "protobuf", schema)
        for number, (recorded, captured, data) in enumerate(timed):
            message = CompressedImage(data=data, format="jpeg").encode()
            writer.add_message(channel, recorded, message, captured, number)
        writer.finish()
    return path


def pictures(*seconds: float) -> list[tuple[float, bytes]]:
    """Pictures numbered from 0."""
    return [(second, jpeg(number)) for number, second in enumerate(seconds)]


def camera(path: Path, **settings: object) -> McapCamera:
    """An open camera."""
    sensor = SensorConfig(id="cam", driver="mcap", settings={"path": str(path), **settings})
    made = McapCamera(sensor, ENVIRONMENT)
    assert made.model is None
    made.open()
    return made


def shown(picture: Picture | None) -> int | None:
    """Which picture it is."""
    return None if picture is None else round(float(picture.image.mean()) / 20)


def asked(source: McapCamera, *seconds: float) -> list[int | None]:
    """What it shows, asked at these seconds after the beginning."""
    return [shown(source.capture(BEGIN + round(at * SECOND), None)) for at in seconds]


def test_a_picture_is_due_as_long_after_the_first_as_it_was_taken(tmp_path: Path) -> None:
    """Taken half a second and a second after it: not a nanosecond sooner; each is given once."""
    source = camera(write(tmp_path / "a.mcap", *pictures(0, 0.5, 1.0)))
    assert asked(source, 0, 0, 0.499_999_999, 0.5, 0.6) == [0, None, None, 1, None]
    before = source.finished
    assert asked(source, 0.999_999_999, 1.0, 1.0, 5) == [None, 2, None, None]
    assert (before, source.finished) == (False, True)
    assert source.skipped == 0


def test_a_picture_is_of_the_time_at_which_it_is_shown(tmp_path: Path) -> None:
    """It bears the mission's stamp and its topic; of others' recordings, no place and no depth."""
    source = camera(write(tmp_path / "a.mcap", *pictures(0, 0.5)))
    source.capture(BEGIN, None)
    late = source.capture(BEGIN + SECOND, None)
    assert late is not None
    assert (late.stamp, late.label, late.odometry, late.depth) == (
        BEGIN + SECOND,
        "/cam",
        None,
        None,
    )


def test_a_loop_begins_again_a_nanosecond_after_its_end(tmp_path: Path) -> None:
    """Two pictures a tenth of a second apart; the second round keeps their distance."""
    source = camera(write(tmp_path / "a.mcap", *pictures(0, 0.1)), loop=True)
    assert asked(source, 0, 0.1, 0.1, 0.100_000_001) == [0, 1, None, 0]
    assert asked(source, 0.2, 0.200_000_001, 0.200_000_002) == [None, 1, 0]
    assert not source.finished
    assert source.skipped == 0


@pytest.mark.timeout(20)  # one that were for ever due would never be done
def test_a_loop_of_one_picture_gives_it_once_each_time(tmp_path: Path) -> None:
    """Asked ten times, even after long whiles."""
    source = camera(write(tmp_path / "a.mcap", *pictures(0)), loop=True)
    assert asked(source, *range(0, 100, 10)) == [0] * 10
    assert asked(source, 90) == [None]


def test_pictures_older_than_the_one_before_are_passed_over_and_counted(tmp_path: Path) -> None:
    """Two of them come too late; one of the very same time does not, and is the newer."""
    path = write(tmp_path / "a.mcap", *pictures(0, 0.5, 0.2, 0.4, 0.5, 0.9))
    source = camera(path)
    assert asked(source, 0) == [0]
    assert source.skipped == 0
    assert asked(source, 0.5) == [4]
    assert source.skipped == 2
    assert asked(source, 0.9) == [5]
    assert source.finished


@pytest.mark.parametrize("leap", [-3600.0, -11.0, 7200.0, 56 * 365.25 * 86_400.0])
@pytest.mark.parametrize("logged", [False, True])
def test_a_clock_that_was_set_hides_no_picture_and_is_told_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, leap: float, *, logged: bool
) -> None:
    """After six of twelve, back or forth; of capture alone, or of the recording's time as well."""
    timed = []
    for number in range(12):
        taken = round((5000 + 0.5 * number + (leap if number > 5 else 0.0)) * SECOND)
        timed.append((taken if logged else 5 * SECOND + number, taken, jpeg(number)))
    source = camera(write_at(tmp_path / "a.mcap", timed))
    assert asked(source, *(0.5 * number for number in range(12))) == [*range(12)]
    assert source.finished
    assert source.skipped == 0
    told = [one for one in caplog.records if "clock" in one.getMessage()]
    assert len(told) == 1


def test_pictures_without_a_time_of_publishing_were_taken_when_recorded(tmp_path: Path) -> None:
    """Zero means that there is none."""
    timed = [((9 + number) * SECOND, 0, jpeg(number)) for number in range(12)]
    source = camera(write_at(tmp_path / "a.mcap", timed))
    assert asked(source, *range(12)) == [*range(12)]
    assert source.finished


def test_the_lens_is_of_the_newest_picture(tmp_path: Path) -> None:
    """Opened, of the first that can be decoded; then of each that is shown."""
    path = write(tmp_path / "a.mcap", (0, b"broken"), (1, jpeg(1)), (2, jpeg(2, width=64)))
    source = camera(path, horizontal_fov=60, pitch=30, yaw=90, mount=(0.1, 0.2, 0.3))

    def lens(width: int) -> CameraModel:
        return CameraModel.from_fov(
            width,
            24,
            math.radians(60),
            mount=(0.1, 0.2, 0.3),
            pitch=math.radians(30),
            yaw=math.radians(90),
        )

    assert source.model == lens(32)
    assert asked(source, 0, 1) == [None, 1]
    assert source.skipped == 1
    assert source.model == lens(32)
    assert asked(source, 2) == [2]
    assert source.model == lens(64)


@pytest.mark.parametrize("broken", [(), ((0, b"broken"), (1, b""))])
def test_pictures_none_of_which_can_be_decoded_are_refused(
    tmp_path: Path, broken: tuple[tuple[float, bytes], ...]
) -> None:
    """Their topic and the file are named; as are those of a camera that gave none."""
    path = write(tmp_path / "a.mcap", *broken)
    with pytest.raises(SourceError) as refused:
        camera(path)
    assert str(refused.value) == f"none of the pictures on /cam of {path} can be decoded"


@pytest.mark.parametrize("loop", [False, True])
def test_of_two_cameras_only_the_one_asked_for_is_played(tmp_path: Path, *, loop: bool) -> None:
    """The left one's pictures are bright, the right one's dark; they alternate."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        described = CompressedImage.get_schema()
        schema = writer.register_schema(described.name, described.encoding, described.data)
        channels = [writer.register_channel(name, "protobuf", schema) for name in ("/l", "/r")]
        for second in range(4):
            data = CompressedImage(data=jpeg(9 - 8 * (second % 2)), format="jpeg").encode()
            writer.add_message(channels[second % 2], second * SECOND, data, second * SECOND)
        writer.finish()
    source = camera(path, topic="/r", loop=loop)
    assert asked(source, 0, 1, 2) == [1, None, 1]
    source = camera(path, topic="/l", loop=loop)
    assert asked(source, 0, 1, 2) == [9, None, 9]


def test_a_recording_without_pictures_says_so(tmp_path: Path) -> None:
    """With a topic asked for and without one."""
    path = tmp_path / "a.mcap"
    FlightRecorder(path, config=RecordingConfig(), provenance=Provenance(0)).close()
    with pytest.raises(SourceError) as refused:
        camera(path)
    assert str(refused.value) == f'{path}: name the pictures\' "topic"; it has: none'
    with pytest.raises(SourceError) as refused:
        camera(path, topic="/cam")
    assert str(refused.value) == f"{path} has no pictures on /cam; it has: none"


def test_a_path_that_is_missing_or_wrong_is_named(tmp_path: Path) -> None:
    """Before anything is opened, or when it is."""
    sensor = SensorConfig(id="cam", driver="mcap", settings={})
    with pytest.raises(ConfigError, match='give the MCAP recording as "path"'):
        McapCamera(sensor, ENVIRONMENT)
    with pytest.raises(SourceError, match=r"cannot open the recording .*nowhere\.mcap: No such"):
        camera(tmp_path / "nowhere.mcap")


def test_of_our_own_recordings_place_and_depth_are_given(tmp_path: Path) -> None:
    """The odometry and the millimetres recorded with each picture, at the mission's own stamps."""
    path = tmp_path / "a.mcap"
    depth = np.full((24, 32), 1234, np.uint16)
    with FlightRecorder(path, config=RecordingConfig(), provenance=Provenance(0)) as recorder:
        for number in range(2):
            header = Header(number, number * SECOND, "drone/cam")
            odometry = Odometry(np.array([number, 0.0, 2.0]), np.zeros(3), yaw=0.0)
            frame = Frame(header, np.zeros((24, 32, 3), np.uint8), None, odometry, depth=depth)
            recorder.write(Message("drone/cam", number, number * SECOND, header, 0, (), frame))
    source = camera(path)
    for number in range(2):
        found = source.capture(BEGIN + number * SECOND, None)
        assert found is not None
        assert found.stamp == BEGIN + number * SECOND
        assert found.odometry is not None
        assert found.odometry.position.tolist() == [number, 0.0, 2.0]
        assert found.depth is not None
        assert np.array_equal(found.depth, depth)
