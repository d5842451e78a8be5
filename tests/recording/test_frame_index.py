"""Any time that is sought gives the picture that was captured last, and what was found in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove.messages import CompressedImage, Timestamp
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from aerodaas.config.model import RecordingConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.waypoints import FollowedTarget, NavigationType, TargetState, VelocityCommand
from aerodaas.recording.playback.flight import read_flight
from aerodaas.recording.playback.frame_index import FrameIndex
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder

COUNT = 200
SOURCE = "tello/camera"
STREAM = "tello/camera"
FOUND = "tello/detector"
FOLLOWER = "tello/follower"
RNG = np.random.default_rng(3)
CAPTURED = np.cumsum(RNG.integers(1, 60, COUNT)) * 1_000_000
"""Captured at uneven times; each is published 5 to 250 ms later, so not always in order."""
PUBLISHED = CAPTURED + RNG.integers(5, 250, COUNT) * 1_000_000


def picture(number: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """One whose grey tells its number."""
    return np.full((48, 64, 3), 20 + number, np.uint8)


def entries(*, ordered: bool) -> Iterator[Message[Any]]:
    """Frames by time of publishing, and a box for every third one, found still later."""
    published = np.maximum.accumulate(PUBLISHED) if ordered else PUBLISHED
    for number in range(COUNT):
        stamp = int(CAPTURED[number])
        header = Header(number, stamp, SOURCE)
        frame = Frame(header, picture(number))
        yield Message(STREAM, number, int(published[number]), header, 0, (), frame)
        if number % 3 == 0:
            found = Detections.of(frame, [Detection((number, 1.0, number + 2, 4.0), "sheep", 0.9)])
            later = int(published[number]) + 30_000_000
            yield Message(FOUND, number, later, Header(number, later, FOUND), 0, (), found)
        if number % 4 == 0:
            box = (number, 1.0, number + 2, 4.0)
            target = FollowedTarget(TargetState.LIKELY, box, 7)
            command = AeroNavigation(
                NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(0.1, target=target)]
            )
            later = int(published[number]) + 40_000_000
            yield Message(FOLLOWER, number, later, header, 0, (), command)


def record(path: Path, images: str) -> Path:
    """Record them; a video's frames are published in order."""
    config = RecordingConfig.model_validate({"images": images})
    provenance = Provenance(started_ns=1_750_000_000_000_000_000, name="film")
    messages = sorted(entries(ordered=images == "h264"), key=lambda message: message.stamp)
    with FlightRecorder(path, config=config, provenance=provenance) as recorder:
        for message in messages:
            recorder.write(message)
    return path


@pytest.fixture(scope="module", params=["jpeg", "png", "h264"])
def film(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[FrameIndex]:
    """Of a recording in each format."""
    path = record(tmp_path_factory.mktemp("film") / "flight.mcap", request.param)
    with Recording.open(path) as recording:
        yield read_flight(recording)[1]


def shown(data: bytes) -> int:
    """The number that a JPEG's grey tells."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return round(float(np.asarray(image).mean())) - 20


@settings(max_examples=60, deadline=None)
@given(times=st.lists(st.integers(0, int(CAPTURED[-1]) + 10**9), min_size=1, max_size=8))
def test_any_time_gives_the_last_picture_captured(film: FrameIndex, times: list[int]) -> None:
    """However one jumps; with exactly its own boxes."""
    for time in times:
        number = int(np.searchsorted(CAPTURED, time, side="right")) - 1
        items = film.at(STREAM, time)
        if number < 0:
            assert items == []
            continue
        *more, (message, data) = items
        found = [one for one in more if one[0]["stream"] == FOUND]
        followed = [one["item"] for one, _ in more if one["stream"] == FOLLOWER]
        assert len(found) + len(followed) == len(more)
        assert message["captured"] == CAPTURED[number]
        assert message["item"]["bytes"] == [len(data)]
        assert not message["item"]["depth"]
        assert abs(shown(data) - number) <= 1
        boxes = [one["item"]["of"]["items"] for one, _ in found]
        assert len(boxes) == (number % 3 == 0)
        assert len(followed) == (number % 4 == 0)
        for target in followed:
            assert target["header"]["stamp"] == CAPTURED[number]
            assert (target["is"], target["of"]["state"]) == ("Target", "likely")
            assert target["of"]["box"] == [number, 1.0, number + 2, 4.0]
        for one, _ in found:
            assert one["item"]["of"]["header"]["stamp"] == CAPTURED[number]


def test_another_cameras_boxes_are_not_drawn(tmp_path: Path) -> None:
    """Two cameras may capture at the same nanosecond."""
    path = tmp_path / "flight.mcap"
    provenance = Provenance(started_ns=1_750_000_000_000_000_000, name="film")
    with FlightRecorder(path, config=RecordingConfig(), provenance=provenance) as recorder:
        for number, camera in enumerate(("left", "right")):
            header = Header(1, 10**9, f"tello/{camera}")
            frame = Frame(header, picture(number))
            recorder.write(Message(header.source, 1, 10**9, header, 0, (), frame))
            found = Detections.of(frame, [Detection((number, 1.0, 9.0, 9.0), "sheep", 0.9)])
            recorder.write(Message(FOUND, number, 2 * 10**9, header, 0, (), found))
    with Recording.open(path) as recording:
        film = read_flight(recording)[1]
        for number, camera in enumerate(("left", "right")):
            (one, _), (message, data) = film.at(f"tello/{camera}", 10**9)
            assert abs(shown(data) - number) <= 1
            assert one["item"]["of"]["header"]["source"] == f"tello/{camera}"
            assert message["stream"] == f"tello/{camera}"


@pytest.mark.parametrize("images", ["jpeg", "h264"])
def test_depth_comes_with_its_own_picture_where_it_is_wanted(tmp_path: Path, images: str) -> None:
    """Two metres on the left, four on the right, and nothing measured above."""
    depth = np.full((48, 64), 2000, np.uint16)
    depth[:, 32:] = 4000
    depth[:8] = 0
    path = tmp_path / "flight.mcap"
    config = RecordingConfig.model_validate({"images": images})
    with FlightRecorder(path, config=config, provenance=Provenance()) as recorder:
        for number in range(2):
            header = Header(number, (1 + number) * 10**9, SOURCE)
            frame = Frame(header, picture(number), depth=depth if number else None)
            recorder.write(Message(STREAM, number, header.stamp, header, 0, (), frame))
    with Recording.open(path) as recording:
        film = read_flight(recording)[1]
        without, _ = film.at(STREAM, 10**9, depth=True)[-1]
        assert not without["item"]["depth"]
        assert len(film.at(STREAM, 2 * 10**9)) == 1
        (told, png), (shot, _) = film.at(STREAM, 2 * 10**9, depth=True)
    assert shot["item"]["depth"]
    assert told["item"]["header"] == shot["item"]["header"]
    assert told["item"]["bytes"] == [len(png)]
    assert told["item"]["range"] == 5.0
    grey = np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED))
    metres = (grey[8:].astype(float) - 1) / 254 * 5
    assert metres[:, :32] == pytest.approx(2.0, abs=0.02)
    assert metres[:, 32:] == pytest.approx(4.0, abs=0.02)
    assert not grey[:8].any()


def write_pictures(path: Path, pictures: Sequence[bytes]) -> Path:
    """Pictures of another software's, one a second, without headers of ours."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        known = CompressedImage.get_schema()
        schema = writer.register_schema(known.name, known.encoding, known.data)
        channel = writer.register_channel("/cam/image", "protobuf", schema)
        for number, data in enumerate(pictures):
            image = CompressedImage(
                timestamp=Timestamp(number, 0), frame_id="cam", data=data, format="jpeg"
            )
            at = 10**9 * (1 + number)
            writer.add_message(channel, at, image.encode(), at, number)
        writer.finish()
    return path


def test_in_place_of_a_broken_picture_comes_the_one_before(tmp_path: Path) -> None:
    """A recording of another's may have any bytes in it; the search for whole ones is bounded."""
    _, whole = cv2.imencode(".jpg", picture(1))
    # What claims to be larger than any picture that is decoded reaches no browser.
    huge = bytearray(whole.tobytes())
    at = huge.index(b"\xff\xc0")
    huge[at + 5 : at + 9] = b"\xff\xff\xff\xff"
    bad = [b"", b"\xff\xd8no", bytes(huge), b"<svg/>"]
    path = write_pictures(tmp_path / "a.mcap", [whole.tobytes(), *bad, whole.tobytes(), *bad * 3])
    with Recording.open(path) as recording:
        flight, film = read_flight(recording)
        assert list(flight.streams) == ["cam"]

        def at_second(second: int) -> int | None:
            items = film.at("cam", second * 10**9)
            return items[-1][0]["captured"] // 10**9 if items else None

        assert [at_second(second) for second in range(6)] == [0, 0, 0, 0, 0, 5]
        assert at_second(12) == 5
        assert at_second(13) is None
        assert at_second(2) == 0
