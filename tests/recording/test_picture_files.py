"""Pictures of another program's recording, as the files of a dataset and of a bag."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.writer import Writer
from ros_bags import read

from aerodaas.recording.export.coco import write_coco
from aerodaas.recording.pictures import shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.ros.bag_writer import write_bag

SECOND = 1_000_000_000


def encoded(suffix: str) -> bytes:
    """A picture of 80 x 60 pixels that lossy encoders keep well."""
    across = np.linspace(0, 255, 80, dtype=np.uint8)
    image = np.repeat(across[None, :, None], 60, axis=0).repeat(3, axis=2)
    return cv2.imencode(suffix, np.ascontiguousarray(image))[1].tobytes()


def foreign(path: Path, pictures: list[tuple[str, bytes]]) -> Path:
    """Formats and files in JSON messages of Foxglove's schema, a second apart."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        channel = writer.register_channel("/front/image", "json", schema)
        for number, (kind, data) in enumerate(pictures):
            value: dict[str, Any] = {"format": kind, "data": base64.b64encode(data).decode()}
            at = (5 + number) * SECOND
            writer.add_message(channel, at, json.dumps({**value, "frame_id": "front"}).encode(), at)
        writer.finish()
    return path


@pytest.fixture
def strange(tmp_path: Path) -> Path:
    """One picture of each kind of file, two that are broken, and one of another format."""
    jpeg, png = encoded(".jpg"), encoded(".png")
    return foreign(
        tmp_path / "strange.mcap",
        [
            ("jpeg", jpeg),
            ("jpeg", b"no picture at all"),
            ("png", png),
            ("png", png[:40]),
            ("webp", encoded(".webp")),
            ("bmp", encoded(".bmp")),
        ],
    )


def test_a_dataset_has_the_files_as_they_were(strange: Path, tmp_path: Path) -> None:
    """Broken ones are left out."""
    with Recording.open(strange) as recording:
        folder = write_coco(recording, tmp_path, interval=0.0)
    listed = json.loads((folder / "annotations.json").read_text())["images"]
    assert [Path(one["file_name"]).suffix for one in listed] == [".jpg", ".png", ".webp"]
    assert {(one["width"], one["height"]) for one in listed} == {(80, 60)}
    written = [(folder / "images" / one["file_name"]).read_bytes() for one in listed]
    assert written == [encoded(".jpg"), encoded(".png"), encoded(".webp")]


def test_a_bag_has_the_files_as_they_were(strange: Path, tmp_path: Path) -> None:
    """The same ones, by the format that they have."""
    with Recording.open(strange) as recording:
        bag = write_bag(recording, tmp_path)
    messages = [message for _, message in read(bag)["/front/image/compressed"]]
    assert [message.format for message in messages] == ["jpeg", "png", "webp"]
    assert messages[1].data.tobytes() == encoded(".png")


def test_other_pictures_become_jpeg(tmp_path: Path) -> None:
    """Raw pixels, which no program opens as a file."""
    path = tmp_path / "raw.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.RawImage", "jsonschema", b"{}")
        channel = writer.register_channel("/front/image", "json", schema)
        data = base64.b64encode(bytes([200]) * (80 * 60)).decode()
        value = {"width": 80, "height": 60, "step": 80, "encoding": "mono8", "data": data}
        writer.add_message(channel, SECOND, json.dumps(value).encode(), SECOND)
        writer.finish()
    with Recording.open(path) as recording:
        (shot,) = shots(recording)
        found = shot.file()
    assert found is not None
    assert (found.format, found.width, found.height) == ("jpeg", 80, 60)
    pixels = cv2.imdecode(np.frombuffer(found.data, np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    assert np.abs(pixels.astype(int) - 200).max() <= 2
