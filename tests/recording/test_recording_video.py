"""Pictures recorded as H.264: as Foxglove wants them, by FFmpeg's own reading, and back."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.frame import PictureType
from foxglove.messages import CompressedVideo
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray
from synthetic_flight import PROVENANCE

from aerodaas.config.model import EnvironmentConfig, RecordingConfig, SensorConfig
from aerodaas.errors import SourceError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.recording.converters.h264 import H264Encoder, is_key_frame
from aerodaas.recording.pictures import frames, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.replay.mcap_camera import McapCamera

RATE = 10
SIZE = (177, 321)
"""Rows and columns: odd, so that the encoder must add to them."""
CONFIG = RecordingConfig(images="h264")


def picture(number: int) -> NDArray[np.uint8]:
    """A disc that moves, its number in the brightness of a corner."""
    image = np.full((*SIZE, 3), (90, 160, 110), np.uint8)
    cv2.circle(image, (20 + 3 * number, 90), 18, (40, 90, 200), -1)
    image[:16, :16] = 4 * number
    return image


def film(path: Path, count: int = 35, damage: int | None = None) -> Path:
    """Record a camera of `count` pictures, of which one may be empty."""
    with FlightRecorder(path, config=CONFIG, provenance=PROVENANCE) as recorder:
        for number in range(count):
            stamp = number * 1_000_000_000 // RATE
            header = Header(number, stamp, "tello/camera")
            image = np.zeros((0, 0, 3), np.uint8) if number == damage else picture(number)
            recorder.write(
                Message("tello/camera", number, stamp, header, 0, (), Frame(header, image))
            )
    return path


def packets(path: Path) -> list[bytes]:
    """The video's messages, read by the mcap library."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        topics = ["/tello/camera/image"]
        return [found.decoded_message.data for found in reader.iter_decoded_messages(topics)]


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 35 pictures, ten a second."""
    return film(tmp_path_factory.mktemp("video") / "flight.mcap")


def units(data: bytes) -> list[int]:
    """Types of the NAL units of one frame."""
    return [part[0] & 0x1F for part in data.split(b"\x00\x00\x01")[1:]]


def test_each_message_is_one_frame_in_annex_b(filmed: Path) -> None:
    """A key frame a second, led by its parameter sets (types 7 and 8), all others without."""
    found = packets(filmed)
    assert len(found) == 35
    assert all(data.startswith((b"\x00\x00\x01", b"\x00\x00\x00\x01")) for data in found)
    keys = [number for number, data in enumerate(found) if is_key_frame(data)]
    assert keys == [0, 10, 20, 30]
    for number, data in enumerate(found):
        kinds = [kind for kind in units(data) if kind != 6]
        assert kinds[:3] == [7, 8, 5] if number in keys else set(kinds) == {1}


def test_ffmpeg_reads_it(filmed: Path, tmp_path: Path) -> None:
    """As a file of its own: as many pictures, one in ten of them key frames, none of type B."""
    path = tmp_path / "camera.h264"
    path.write_bytes(b"".join(packets(filmed)))
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        found = list(film.decode(stream))
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 322, 178)
        assert not stream.codec_context.has_b_frames
    kinds = "".join(PictureType(one.pict_type).name for one in found)
    assert kinds == ("I" + 9 * "P") * 3 + "IPPPP"
    assert [one.key_frame for one in found] == [kind == "I" for kind in kinds]


def test_decoding_may_begin_at_any_key_frame(filmed: Path) -> None:
    """PyAV on its own, from the third key frame on, sees the pictures that were recorded."""
    codec = av.CodecContext.create("h264", "r")
    seen = [
        frame.to_ndarray(format="bgr24")
        for data in packets(filmed)[20:]
        for frame in codec.decode(av.Packet(data))
    ]
    seen += [frame.to_ndarray(format="bgr24") for frame in codec.decode(None)]
    assert len(seen) == 15
    for number, image in enumerate(seen, 20):
        assert cv2.PSNR(image[: SIZE[0], : SIZE[1]], picture(number)) > 30


def test_pictures_come_back(filmed: Path) -> None:
    """Every frame in its own size and colours, at its own time."""
    with Recording.open(filmed) as recording:
        back = list(frames(recording))
    assert [frame.header.id for frame in back] == list(range(35))
    for frame in back:
        assert frame.image.shape == (*SIZE, 3)
        assert cv2.PSNR(frame.image, picture(frame.header.id)) > 30


def test_a_single_picture_costs_its_group_only(filmed: Path) -> None:
    """Seeking: the frame asked for is the same as when all before it were decoded."""
    with Recording.open(filmed) as recording:
        everything = [frame.image for frame in frames(recording)]
        stamps = {1_700_000_000, 3_000_000_000}
        asked = list(frames(recording, stamps=stamps))
        late = list(shots(recording))
        backwards = [shot.image() for shot in reversed(late)]
    assert [frame.header.id for frame in asked] == [17, 30]
    for frame in asked:
        assert np.array_equal(frame.image, everything[frame.header.id])
    for image, expected in zip(reversed(backwards), everything, strict=True):
        assert image is not None
        assert np.array_equal(image, expected)


def test_a_picture_that_cannot_be_encoded_costs_only_itself(tmp_path: Path) -> None:
    """The others come back, and the log says which was lost."""
    path = film(tmp_path / "flight.mcap", 8, damage=3)
    with Recording.open(path) as recording:
        assert [frame.header.id for frame in frames(recording)] == [0, 1, 2, 4, 5, 6, 7]
        (told,) = recording.records(topics=["/log"])
    assert told.value.message.startswith("cannot record a Frame")


def test_time_that_runs_backwards_begins_anew() -> None:
    """A stamp before the last key frame's gets a key frame, and so does a new second."""
    encoder = H264Encoder(320, 176, 23)
    image = picture(0)[:176, :320]
    stamps = [5_000_000_000, 5_100_000_000, 4_000_000_000, 4_100_000_000, 9_000_000_000]
    keys = [is_key_frame(encoder.encode(image, stamp)) for stamp in stamps]
    assert keys == [True, False, True, False, True]


def camera_of(path: Path) -> McapCamera:
    """A camera that plays `path`."""
    sensor = SensorConfig(id="cam", driver="mcap", rate=RATE, settings={"path": str(path)})
    return McapCamera(sensor, EnvironmentConfig.model_validate({"robots": [{"id": "tello"}]}))


def test_a_camera_plays_it(filmed: Path) -> None:
    """At half its rate, every other picture, and then no more."""
    camera = camera_of(filmed)
    camera.open()
    seen = []
    for turn in range(20):
        shown = camera.capture(turn * 200_000_000, None)
        if shown is not None:
            seen.append(round(float(shown.image[4:12, 4:12].mean()) / 4))
    assert seen[:17] == list(range(0, 34, 2))
    assert camera.finished
    assert camera.skipped == 0
    camera.close()


@pytest.mark.parametrize(
    ("form", "words"), [("h265", "'h265' cannot be decoded"), ("h264", "none of")]
)
def test_videos_of_others_that_cannot_be_shown(tmp_path: Path, form: str, words: str) -> None:
    """Another codec is named; a video without a key frame has no picture."""
    path = tmp_path / "theirs.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        described = CompressedVideo.get_schema()
        schema = writer.register_schema(described.name, described.encoding, described.data)
        channel = writer.register_channel("/cam", "protobuf", schema)
        message = CompressedVideo(data=b"\x00\x00\x01\x41\x9a\x00", format=form).encode()
        writer.add_message(channel, 0, message, 0)
        writer.finish()
    with pytest.raises(SourceError, match=words):
        camera_of(path).open()
