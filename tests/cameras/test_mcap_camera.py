"""Recordings of others, and our own, as cameras."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from foxglove.messages import CompressedImage, RawImage, Timestamp
from mcap.writer import Writer
from mcap_ros2.writer import Writer as RosWriter
from numpy.typing import NDArray

from aerodaas.cameras.base import Camera
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.errors import SourceError
from aerodaas.recording.replay.mcap_camera import McapCamera

ENVIRONMENT = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
SECOND = 1_000_000_000
HEADER = """std_msgs/Header header
"""
HEADER_TYPES = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
COMPRESSED = HEADER + "string format\nuint8[] data\n" + HEADER_TYPES
RAW = (
    HEADER
    + "uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
    + "uint8[] data\n"
    + HEADER_TYPES
)


def picture(number: int) -> NDArray[np.uint8]:
    """A picture that tells its number by its colour: blue, green, red rise differently."""
    image = np.zeros((60, 80, 3), np.uint8)
    image[:] = (20 * number, 200 - 20 * number, 30)
    return image


def jpeg(number: int) -> bytes:
    """The same, as JPEG."""
    return cv2.imencode(".jpg", picture(number))[1].tobytes()


def camera(path: Path, **settings: object) -> McapCamera:
    """An open camera on a recording."""
    sensor = SensorConfig(id="cam", driver="mcap", settings={"path": str(path), **settings})
    made: McapCamera = load_plugin("cameras", "mcap")(sensor, ENVIRONMENT)
    made.open()
    assert isinstance(made, Camera)
    return made


def head(number: int) -> dict[str, object]:
    """A ROS header."""
    return {"stamp": {"sec": number, "nanosec": 0}, "frame_id": "front"}


def write_ros(path: Path, kind: str, times: list[float]) -> None:
    """Pictures of ROS 2, one at each of `times` seconds."""
    writer = RosWriter(str(path))
    compressed = kind == "compressed"
    schema = writer.register_msgdef(
        f"sensor_msgs/msg/{'CompressedImage' if compressed else 'Image'}",
        COMPRESSED if compressed else RAW,
    )
    for number, time in enumerate(times):
        image = picture(number)
        message: dict[str, object] = {"header": head(number), "format": "jpeg"}
        if compressed:
            message["data"] = jpeg(number)
        else:
            rows = np.zeros((60, 250), np.uint8)
            rgb = kind == "rgb8"
            rows[:, :240] = (image[..., ::-1] if rgb else image).reshape(60, 240)
            message |= {"height": 60, "width": 80, "encoding": kind, "is_bigendian": 0}
            message |= {"step": 250, "data": rows.tobytes()}
        stamp = int((5 + time) * SECOND)
        writer.write_message("/front/image", schema, message, stamp, stamp)
    writer.finish()


def write_foxglove(path: Path, kind: str, times: list[float]) -> None:
    """Pictures of Foxglove's schemas, as protobuf or JSON."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        described = (RawImage if kind == "raw" else CompressedImage).get_schema()
        if kind == "json":
            schema = writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        else:
            schema = writer.register_schema(described.name, described.encoding, described.data)
        encoding = "json" if kind == "json" else "protobuf"
        channel = writer.register_channel("/front/image", encoding, schema)
        for number, time in enumerate(times):
            stamp = int((5 + time) * SECOND)
            if kind == "json":
                text = base64.b64encode(jpeg(number)).decode()
                data = json.dumps({"format": "jpeg", "data": text, "frame_id": "front"}).encode()
            elif kind == "raw":
                data = RawImage(
                    timestamp=Timestamp(number),
                    width=80,
                    height=60,
                    encoding="bgr8",
                    step=240,
                    data=picture(number).tobytes(),
                ).encode()
            else:
                data = CompressedImage(data=jpeg(number), format="jpeg").encode()
            writer.add_message(channel, stamp, data, stamp)
        writer.finish()


@pytest.mark.parametrize("kind", ["compressed", "bgr8", "rgb8", "protobuf", "json", "raw"])
def test_every_kind_shows_the_same(tmp_path: Path, kind: str) -> None:
    """The same pictures at the same times, whoever recorded them."""
    path = tmp_path / "theirs.mcap"
    write = write_ros if kind in {"compressed", "bgr8", "rgb8"} else write_foxglove
    write(path, kind, [0.0, 0.5, 1.0])
    source = camera(path, horizontal_fov=60)
    start = 7 * SECOND
    shown = [source.capture(start + at * SECOND // 4, None) for at in range(5)]
    assert [found is not None for found in shown] == [True, False, True, False, True]
    for number, found in enumerate(found for found in shown if found):
        assert np.abs(found.image.astype(int) - picture(number)).max() <= 6
    assert source.finished
    assert source.skipped == 0
    assert source.model is not None
    assert (source.model.width, source.model.height) == (80, 60)
    source.close()


def test_which_camera_must_be_said(tmp_path: Path) -> None:
    """With two cameras, without any, or with a wrong topic, what there is is named."""
    path = tmp_path / "two.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        described = CompressedImage.get_schema()
        schema = writer.register_schema(described.name, described.encoding, described.data)
        for topic in ("/left", "/right"):
            channel = writer.register_channel(topic, "protobuf", schema)
            writer.add_message(channel, 0, CompressedImage(data=jpeg(1)).encode(), 0)
        writer.finish()
    with pytest.raises(SourceError, match="/left, /right"):
        camera(path)
    with pytest.raises(SourceError, match=r"no pictures on /up.*/left, /right"):
        camera(path, topic="/up")
    camera(path, topic="/left").close()
    (tmp_path / "text.mcap").write_text("hello")
    with pytest.raises(SourceError, match="not an MCAP recording"):
        camera(tmp_path / "text.mcap")


def test_unknown_pixels_say_which_are_known(tmp_path: Path) -> None:
    """A depth image is refused in words."""
    path = tmp_path / "depth.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        described = RawImage.get_schema()
        schema = writer.register_schema(described.name, described.encoding, described.data)
        channel = writer.register_channel("/depth", "protobuf", schema)
        image = RawImage(width=2, height=2, encoding="32FC1", step=8, data=bytes(16))
        writer.add_message(channel, 0, image.encode(), 0)
        writer.finish()
    with pytest.raises(SourceError, match=r"32FC1.*rgb8"):
        camera(path)
