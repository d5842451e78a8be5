"""A camera on a ROS 2 topic."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from ros_domain import DOMAIN
from waiting import until

from aerodaas.cameras.base import Camera, Picture
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.errors import ConfigError, SourceError
from aerodaas.extensions.ros2.driver import camera as module
from aerodaas.extensions.ros2.driver.camera import Ros2Camera
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.link import RosLink, RosPublisher

NOW = 100_000_000_000
"""Mission time of captures, nanoseconds."""


def camera_of(topic: str, **settings: Any) -> Ros2Camera:  # noqa: ANN401
    """A camera that a drone of the same driver carries."""
    robot = RobotConfig.model_validate(
        {
            "id": "x3",
            "driver": "ros2",
            "settings": {"odometry": "/o", "velocity": "/v", "domain": DOMAIN},
            "sensors": [{"id": "eye", "settings": {"topic": topic, **settings}}],
        }
    )
    return Ros2Camera(robot.sensors[0], EnvironmentConfig(robots=[robot]))


def gradient() -> NDArray[np.uint8]:
    """Four rows of six pixels, BGR, each of its own colour."""
    return np.arange(72, dtype=np.uint8).reshape(4, 6, 3)


def raw(image: NDArray[np.uint8], encoding: str, sec: int = 1, pad: int = 0) -> Any:  # noqa: ANN401
    """A raw picture, with `pad` bytes after each row."""
    height, width = image.shape[:2]
    rows = np.pad(image.reshape(height, -1), ((0, 0), (0, pad)))
    message = types.ros_message(
        types.IMAGE,
        height=height,
        width=width,
        encoding=encoding,
        step=rows.shape[1],
        data=rows.reshape(-1),
    )
    message.header.stamp.sec = sec
    return message


@contextmanager
def opened(camera: Ros2Camera, publisher: RosPublisher, first: Any) -> Iterator[Ros2Camera]:  # noqa: ANN401
    """Open `camera` while `first` is published again and again, and take that picture."""
    stop = threading.Event()

    def tell() -> None:
        while not stop.wait(0.02):
            publisher.publish(first)

    thread = threading.Thread(target=tell)
    thread.start()
    try:
        camera.open()
    finally:
        stop.set()
        thread.join()
    try:
        yield camera
    finally:
        camera.close()


def next_picture(camera: Ros2Camera) -> Picture:
    """The next one that comes."""
    found: list[Picture] = []

    def captured() -> bool:
        picture = camera.capture(NOW, None)
        found.extend([] if picture is None else [picture])
        return bool(found)

    until(captured)
    return found[0]


@pytest.mark.parametrize("encoding", ["bgr8", "rgb8", "mono8"])
def test_raw_pictures_come_as_bgr(ros_link: RosLink, topics: str, encoding: str) -> None:
    """Whatever order their channels have, and however long their rows are."""
    image = gradient()
    sent = {"bgr8": image, "rgb8": image[..., ::-1], "mono8": image[..., 0]}[encoding]
    expected = np.repeat(image[..., :1], 3, 2) if encoding == "mono8" else image
    publisher = ros_link.publisher(f"{topics}/image", types.IMAGE)
    with opened(camera_of(f"{topics}/image"), publisher, raw(sent, encoding, pad=5)) as camera:
        assert isinstance(camera, Camera)
        assert camera.model is not None
        assert (camera.model.width, camera.model.height) == (6, 4)
        np.testing.assert_array_equal(next_picture(camera).image, expected)


def test_compressed_pictures_are_decoded(ros_link: RosLink, topics: str) -> None:
    """By the end of the topic's name."""
    topic = f"{topics}/image/compressed"
    flat = np.full((32, 48, 3), (200, 100, 50), np.uint8)
    data = cv2.imencode(".jpg", flat)[1].reshape(-1)
    message = types.ros_message(
        types.COMPRESSED_IMAGE, format="bgr8; jpeg compressed bgr8", data=data
    )
    message.header.stamp.sec = 1
    publisher = ros_link.publisher(topic, types.COMPRESSED_IMAGE)
    with opened(camera_of(topic), publisher, message) as camera:
        picture = next_picture(camera)
    assert picture.image.shape == (32, 48, 3)
    assert np.abs(picture.image.astype(int) - flat).max() < 6


def test_the_newest_picture_comes_once(ros_link: RosLink, topics: str) -> None:
    """A repetition and an older one are no news; damaged ones are counted."""
    publisher = ros_link.publisher(f"{topics}/image", types.IMAGE)
    image = gradient()
    with opened(camera_of(f"{topics}/image"), publisher, raw(image, "bgr8")) as camera:
        next_picture(camera)
        for second in (9, 9, 8):
            publisher.publish(raw(image + second, "bgr8", second))
            time.sleep(0.1)
        np.testing.assert_array_equal(next_picture(camera).image, image + 9)
        assert camera.capture(NOW, None) is None
        short = raw(image, "bgr8", 20)
        short.data = short.data[:-1]
        publisher.publish(short)

        def skipped() -> bool:
            assert camera.capture(NOW, None) is None
            return camera.skipped == 1

        until(skipped)
        publisher.publish(raw(image + 21, "bgr8", 21))
        np.testing.assert_array_equal(next_picture(camera).image, image + 21)


def test_a_picture_is_as_old_as_a_clock_of_ours_says(ros_link: RosLink, topics: str) -> None:
    """And as its arrival where the stamp is another clock's."""
    half = 500_000_000
    image, publisher = gradient(), ros_link.publisher(f"{topics}/image", types.IMAGE)
    aged = raw(image, "bgr8")
    stamp = aged.header.stamp
    stamp.sec, stamp.nanosec = divmod(time.time_ns() - half, 1_000_000_000)
    with opened(camera_of(f"{topics}/image"), publisher, aged) as camera:
        assert next_picture(camera).stamp <= NOW - half
    with opened(camera_of(f"{topics}/image"), publisher, raw(image, "bgr8", 7)) as camera:
        taken = time.monotonic_ns()
        publisher.publish(raw(image, "bgr8", 8))
        time.sleep(0.1)
        age = NOW - next_picture(camera).stamp
        assert 0 <= age <= time.monotonic_ns() - taken + half


def test_a_pixel_format_that_nobody_knows_is_refused(ros_link: RosLink, topics: str) -> None:
    """By its name, with those that are known."""
    publisher = ros_link.publisher(f"{topics}/image", types.IMAGE)
    strange = raw(gradient(), "plasma12")
    with (
        pytest.raises(SourceError, match=r"'plasma12' cannot be decoded.*bgr8"),
        opened(camera_of(f"{topics}/image"), publisher, strange),
    ):
        pass


def test_a_topic_without_pictures_is_told(
    ros_link: RosLink, topics: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With those that there are, or what the topic is instead."""
    monkeypatch.setattr(module, "_FIRST_PICTURE", 0.6)
    kept = ros_link.publisher(f"{topics}/image/compressed", types.COMPRESSED_IMAGE)
    with pytest.raises(SourceError, match=rf"no picture on /no/compressed .*{topics}/image"):
        camera_of("/no/compressed").open()
    other = ros_link.publisher(f"{topics}/raw/compressed", types.IMAGE)
    wrong = f"{topics}/raw/compressed is sensor_msgs/msg/Image, and not .*/CompressedImage"
    with pytest.raises(SourceError, match=wrong):
        camera_of(f"{topics}/raw/compressed").open()
    assert not kept.listeners
    assert not other.listeners


def test_damaged_pictures_alone_are_told(
    ros_link: RosLink, topics: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not as if there were none."""
    monkeypatch.setattr(module, "_FIRST_PICTURE", 0.6)
    publisher = ros_link.publisher(f"{topics}/image", types.IMAGE)
    huge = raw(gradient(), "bgr8")
    huge.width = huge.height = 1_000_000
    with (
        pytest.raises(SourceError, match="cannot be decoded: they are damaged"),
        opened(camera_of(f"{topics}/image"), publisher, huge),
    ):
        pass


def test_settings_are_checked() -> None:
    """A topic is needed; a path is another driver's."""
    with pytest.raises(ConfigError, match=r"x3/eye: settings.*topic"):
        camera_of("no topic")
    with pytest.raises(ConfigError, match='a "topic", and no "path"'):
        camera_of("/image", path="rtsp://host/video")
