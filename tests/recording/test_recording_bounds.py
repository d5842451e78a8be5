"""A small file costs little, whatever it claims to hold."""

from __future__ import annotations

import base64
import struct
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
import pytest
import zstandard
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer
from mcap_files import Said, write_file

from aerodaas.cameras.images import check_picture, decode_image
from aerodaas.cameras.picture_size import MAX_PIXELS, picture_format, picture_size
from aerodaas.errors import RecordingError
from aerodaas.recording.converters.h264 import H264Decoder, H264Encoder
from aerodaas.recording.decoding.limits import (
    MAX_ATTACHMENT,
    MAX_CHANNELS,
    MAX_CHUNK,
    MAX_METADATA,
)
from aerodaas.recording.decoding.messages import BrokenMessageError, plain_fields
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.report import write_report
from aerodaas.recording.tables import table_of

MAGIC = b"\x89MCAP0\r\n"
COMPRESSED = "foxglove.CompressedImage"
ENOUGH = 64 << 20
"""Bytes that reading any of these files may take."""


@contextmanager
def little_memory(enough: int = ENOUGH) -> Iterator[None]:
    """Fail if more than `enough` bytes were taken at any time."""
    tracemalloc.start()
    try:
        yield
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < enough


def record(opcode: int, body: bytes) -> bytes:
    """One record of MCAP."""
    return struct.pack("<BQ", opcode, len(body)) + body


def chunk(claimed: int, packed: bytes, kind: bytes = b"zstd", crc: int = 0) -> bytes:
    """A chunk that claims to have a size."""
    head = struct.pack("<QQQI", 0, 1, claimed, crc)
    return record(
        Opcode.CHUNK,
        head + struct.pack("<I", len(kind)) + kind + struct.pack("<Q", len(packed)) + packed,
    )


def zeros(size: int) -> bytes:
    """That many zeros, packed, as one message of an unknown channel each."""
    one = record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 1, 1) + bytes((1 << 20) - 31))
    packer = zstandard.ZstdCompressor(level=3).compressobj()
    return b"".join([*(packer.compress(one) for _ in range(size >> 20)), packer.flush()])


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A file that was not closed, to put other records behind."""
    said = [Said("/a", 1_000 + number, number) for number in range(3)]
    path = tmp_path_factory.mktemp("good") / "a.mcap"
    return write_file(path, said, finish=False).read_bytes()


def test_gigabytes_in_a_small_file_are_not_unpacked(tmp_path: Path) -> None:
    """A file of less than a megabyte that unpacks to 6.25 GB is refused by its name and sizes."""
    bomb = chunk(100 << 20, zeros(100 << 20))
    path = tmp_path / "bomb.mcap"
    path.write_bytes(MAGIC + bomb * 64)
    assert path.stat().st_size < 1 << 20
    begun = time.monotonic()
    one_chunk = ENOUGH + MAX_CHUNK
    with (
        little_memory(one_chunk),
        pytest.raises(RecordingError, match=r"bomb\.mcap has .* would unpack to"),
    ):
        write_report(path, tmp_path / "report")
    assert time.monotonic() - begun < 20


def test_a_closed_file_is_refused_by_its_index(tmp_path: Path) -> None:
    """The index tells the sizes, and nothing is unpacked at all."""
    file = BytesIO()
    writer = Writer(file, compression=CompressionType.ZSTD, chunk_size=16 << 20)
    writer.start()
    channel = writer.register_channel("/a", "json", 0)
    for number in range(100):
        writer.add_message(channel, number, bytes(1 << 20), number)
    writer.finish()
    path = tmp_path / "bomb.mcap"
    path.write_bytes(file.getvalue())
    with little_memory(), pytest.raises(RecordingError, match="would unpack to"):
        Recording.open(path)


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
def test_a_chunk_that_holds_more_than_it_claims_is_skipped(
    tmp_path: Path, good: bytes, kind: str
) -> None:
    """It is counted, unpacked no further than claimed, and the rest is read."""
    if kind == "zstd":
        packed = zstandard.compress(bytes(500 << 20))
    else:
        import lz4.frame  # noqa: PLC0415 - here alone

        packed = lz4.frame.compress(bytes(500 << 20))
    path = tmp_path / "a.mcap"
    path.write_bytes(good + chunk(1000, packed, kind.encode()))
    with little_memory(), Recording.open(path) as recording:
        assert recording.damaged == 1
        assert [it.value["number"] for it in recording.records()] == [0, 1, 2]


def test_a_chunk_beyond_the_bound_is_skipped(tmp_path: Path, good: bytes) -> None:
    """One that truly is larger, in a file large enough to hold it."""
    path = tmp_path / "a.mcap"
    padding = record(0x99, np.random.default_rng(0).bytes(2 << 20))
    path.write_bytes(good + padding + chunk(MAX_CHUNK + 1, zstandard.compress(bytes(1000))))
    with Recording.open(path) as recording:
        assert recording.damaged == 1
        assert len(list(recording.records())) == 3


@pytest.mark.parametrize("claimed", [0, 999, 1001, 2**63, 2**64 - 1])
def test_a_false_size_costs_the_chunk(tmp_path: Path, good: bytes, claimed: int) -> None:
    """Or the file, where it claims to be huge."""
    path = tmp_path / "a.mcap"
    path.write_bytes(good + chunk(claimed, zstandard.compress(bytes(1000))))
    if claimed > 1 << 40:
        with pytest.raises(RecordingError, match="would unpack to"):
            Recording.open(path)
        return
    with little_memory(), Recording.open(path) as recording:
        assert recording.damaged == 1
        assert len(list(recording.records())) == 3


def test_attachments_and_metadata_have_bounds(tmp_path: Path) -> None:
    """A large attachment is listed and refused with the bound; large metadata are skipped."""
    file = BytesIO()
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start()
    writer.add_metadata("much", {"text": "x" * (MAX_METADATA + 1)})
    writer.add_metadata("little", {"text": "x"})
    writer.add_attachment(1, 1, "much", "text/plain", bytes(MAX_ATTACHMENT))
    writer.finish()
    path = tmp_path / "a.mcap"
    path.write_bytes(file.getvalue())
    with little_memory(), Recording.open(path) as recording:
        assert list(recording.metadata) == ["little"]
        assert recording.attachments == ["much"]
        with pytest.raises(RecordingError, match=f"more than the {MAX_ATTACHMENT}"):
            recording.attachment("much")


def test_a_length_in_the_file_is_not_believed(tmp_path: Path) -> None:
    """Names of four gigabytes in a record of a few bytes."""
    name = struct.pack("<I", 2**32 - 1) + b"x"
    bodies = ((Opcode.METADATA, name), (Opcode.ATTACHMENT, bytes(16) + name))
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + b"".join(record(*body) for body in bodies))
    with little_memory(), Recording.open(path) as recording:
        assert list(recording.records()) == []


def repeated(writer: Writer, kind: str, count: int) -> None:
    """Have a file's index name its only record of a kind so often, by other names."""
    indexes = getattr(writer, f"_Writer__{kind}_indexes")
    (one,) = indexes
    indexes += [replace(one, name=f"{one.name}{number}") for number in range(1, count)]
    setattr(writer._Writer__statistics, f"{kind}_count", count)  # type: ignore[attr-defined]


@pytest.mark.parametrize("lies", [False, True])
def test_what_the_index_names_a_thousand_times_is_read_once(tmp_path: Path, *, lies: bool) -> None:
    """One megabyte that would be a thousand; also where the index tells of a few bytes each."""
    file = BytesIO()
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start()
    writer.add_metadata("much", {"text": "x" * (MAX_METADATA - 100)})
    repeated(writer, "metadata", 1000)
    if lies:
        for one in writer._Writer__metadata_indexes:  # type: ignore[attr-defined]
            one.length = 10
    writer.finish()
    path = tmp_path / "a.mcap"
    path.write_bytes(file.getvalue())
    with little_memory(), Recording.open(path) as recording:
        assert list(recording.metadata) == ["much"]


def test_an_attachment_is_listed_once(tmp_path: Path) -> None:
    """Who reads all of a kind would read the same bytes for each of its names."""
    file = BytesIO()
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start()
    writer.add_attachment(1, 1, "vehicle_logs/one/", "text/plain", bytes(1 << 20))
    repeated(writer, "attachment", 1000)
    writer.finish()
    path = tmp_path / "a.mcap"
    path.write_bytes(file.getvalue())
    with Recording.open(path) as recording:
        assert recording.attachments == ["vehicle_logs/one/"]
        assert recording.attachment("vehicle_logs/one/") == bytes(1 << 20)


def test_a_name_ends_with_its_record(tmp_path: Path) -> None:
    """Each of a thousand attachments claims the rest of the file for its name."""
    body = bytes(16) + struct.pack("<I", 2**32 - 1) + b"x"
    path = tmp_path / "a.mcap"
    padding = record(0x7F, b"y" * (1 << 20))
    path.write_bytes(MAGIC + record(Opcode.ATTACHMENT, body) * 1000 + padding)
    with little_memory(), Recording.open(path) as recording:
        assert recording.attachments == ["x"]


def test_a_message_of_empty_messages_is_no_table(tmp_path: Path) -> None:
    """Two bytes of each, packed to nearly none, take a hundred as a row."""
    files = FileDescriptorSet()
    file = files.file.add(name="many.proto", package="x", syntax="proto3")
    file.message_type.add(name="Nothing")
    field = file.message_type.add(name="Many").field.add(name="one", number=1, label=3, type=11)
    field.type_name = ".x.Nothing"
    path = tmp_path / "a.mcap"
    with path.open("wb") as output:
        writer = Writer(output)
        writer.start()
        schema = writer.register_schema("x.Many", "protobuf", files.SerializeToString())
        channel = writer.register_channel("/many", "protobuf", schema)
        writer.add_message(channel, 1, b"\x0a\x00" * 10, 1)
        writer.add_message(channel, 2, b"\x0a\x00" * (1 << 20), 2)
        writer.finish()
    assert path.stat().st_size < 10_000
    with Recording.open(path) as recording:
        few, many = (record.value for record in recording.records())
    assert plain_fields(few) == {"one": [{}] * 10}
    with little_memory(), pytest.raises(BrokenMessageError, match="bytes of fields"):
        plain_fields(many)


def test_messages_of_fields_of_their_own_are_no_table(tmp_path: Path) -> None:
    """Each row would have the fields of all others, too."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as output:
        writer = Writer(output)
        writer.start()
        channel = writer.register_channel("/odd", "json", 0)
        for number in range(2000):
            writer.add_message(channel, number, b'{"%d": 1}' % number, number)
        writer.finish()
    with (
        little_memory(),
        Recording.open(path) as recording,
        pytest.raises(RecordingError, match=r"2003 different fields.*no table"),
    ):
        table_of(recording, "/odd")


def test_channels_have_a_bound(tmp_path: Path) -> None:
    """Tens of thousands of them are no flight."""
    path = write_file(
        tmp_path / "a.mcap", [Said(f"/{number}", 1_000, 0) for number in range(MAX_CHANNELS + 1)]
    )
    with pytest.raises(RecordingError, match="channels"):
        Recording.open(path)


def png(width: int, height: int) -> bytes:
    """The beginning of a PNG of that size."""
    return b"\x89PNG\r\n\x1a\n" + struct.pack(
        ">I4sIIBBBBB", 13, b"IHDR", width, height, 8, 2, 0, 0, 0
    )


def jpeg(width: int, height: int, scans: int = 1) -> bytes:
    """The headers of a JPEG of that size, after a comment and a stray byte."""
    frame = b"\xff\xc0" + struct.pack(">HBHHB", 17, 8, height, width, 3) + bytes(9)
    return b"\xff\xd8\xff\xfe\x00\x04\xff\xc0\x00" + frame + b"\xff\xda\x00\x08" * scans


@pytest.mark.parametrize(
    ("data", "size"),
    [
        (png(640, 360), (640, 360)),
        (jpeg(640, 360), (640, 360)),
        (jpeg(640, 360, scans=1000), None),
        (b"BM" + bytes(100), None),
        (b"\xff\xd8" + b"\xff" * 50, None),
        (b"\xff\xd8\xff\xc0\x00", None),
        (b"", None),
    ],
)
def test_the_size_is_told_before_decoding(data: bytes, size: tuple[int, int] | None) -> None:
    """Of the formats that are decoded; of none that OpenCV would try beside these."""
    assert picture_size(data) == size


@pytest.mark.parametrize(
    ("ending", "kind"),
    [(".jpg", "jpeg"), (".png", "png"), (".webp", "webp"), (".bmp", None), (".tiff", None)],
)
def test_the_format_is_that_of_the_first_bytes(ending: str, kind: str | None) -> None:
    """As OpenCV writes it; a signature that is cut off is none."""
    done, content = cv2.imencode(ending, np.zeros((8, 8, 3), np.uint8))
    assert done
    assert picture_format(content.tobytes()) == kind
    assert picture_format(content.tobytes()[:1]) is None


@pytest.mark.parametrize("side", [8192, 30_000, 65_000])
def test_a_picture_that_would_be_huge_is_not_decoded(side: int) -> None:
    """As PNG and JPEG, by its header alone."""
    for data in (png(side, side), jpeg(side, side)):
        with little_memory():
            value = {"data": base64.b64encode(data).decode()}
            assert decode_image(COMPRESSED, value) is None


def test_a_raw_picture_is_as_large_as_its_data() -> None:
    """Its fields may claim what they like."""
    for width, height, step in ((2**31, 2**31, 0), (16, 2**40, 48), (0, 5, 1), (10, 10, 5)):
        value = {"encoding": "bgr8", "width": width, "height": height, "step": step, "data": "AAAA"}
        with little_memory():
            assert decode_image("foxglove.RawImage", value) is None


@pytest.mark.parametrize("data", [10**12, 3.5, None, [1, 999], {"a": 1}, "no Base64!"])
def test_data_that_are_no_bytes_are_refused(data: object) -> None:
    """A number would be that many zeros."""
    with little_memory(), pytest.raises((ValueError, TypeError)):
        check_picture({"data": data, "format": "jpeg"}, video=False)


def test_a_huge_video_is_not_decoded() -> None:
    """One frame of a few kilobytes, whose header claims more than the bound."""
    width, height = 8192, MAX_PIXELS // 8192 + 16
    encoded = H264Encoder(width, height, 51).encode(np.zeros((height, width, 3), np.uint8), 0)
    assert len(encoded) < 1 << 20
    assert H264Decoder().decode([encoded], 0) is None
