"""The camera's page shows the newest picture with what was found in it."""

from __future__ import annotations

import http.client

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from aerodaas.recording.report.camera_page import CameraPage
from aerodaas.types.data import Detection, Detections, Frame, Header
from aerodaas.types.errors import ConfigError
from aerodaas.types.status import Message, MissionState, MissionStatus

GREY = 90


def frame(stamp: int, source: str = "drone/cam") -> Frame:
    """An even picture."""
    return Frame(Header(stamp, stamp, source), np.full((120, 160, 3), GREY, np.uint8))


def message(
    item: Frame | Detections | MissionStatus, header: Header, stream: str
) -> Message[object]:
    """As it comes to the recorder."""
    return Message(stream, 0, header.stamp, header, 0, (), item)


def boxes(of: Frame) -> Detections:
    """One box in the middle."""
    return Detections.of(of, [Detection((40.0, 30.0, 120.0, 90.0), "vest", 0.9)])


def fed(page: CameraPage, *frames: Frame) -> None:
    """Give it frames."""
    for one in frames:
        page.put(message(one, one.header, one.header.source))


def get(page: CameraPage, path: str, parts: int = 0) -> tuple[int, bytes]:
    """Ask as a browser does; of a stream read `parts` pictures and return the last."""
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = b""
    if not parts:
        body = answer.read()
    for _ in range(parts):
        head = b"".join(iter(answer.readline, b"\r\n"))
        length = int(head.split(b"Content-Length:")[1].split(b"\r\n")[0])
        body = answer.read(length)
        answer.readline()
    connection.close()
    return answer.status, body


def changed(image: NDArray[np.uint8], rows: slice, columns: slice) -> bool:
    """Whether something was drawn there."""
    return bool((image[rows, columns] != GREY).any())


def test_boxes_are_drawn_into_the_frame_that_they_were_found_in() -> None:
    """A newer frame without boxes does not take its place, once anybody looks for things."""
    with CameraPage("127.0.0.1:0") as page:
        old, new = frame(1), frame(2)
        fed(page, old, new)
        plain = page.picture("drone/cam")
        assert plain is not None
        assert not changed(plain, slice(20, 95), slice(30, 130))
        page.put(message(boxes(old), old.header, "drone/detector"))
        drawn = page.picture("drone/cam")
        assert drawn is not None
        assert changed(drawn, slice(28, 33), slice(38, 123))


def test_the_state_stands_below() -> None:
    """Of the camera's own robot."""
    with CameraPage("127.0.0.1:0") as page:
        fed(page, frame(1), frame(1, "other/cam"))
        status = MissionStatus(5_000_000_000, MissionState.FOLLOWING, "following commands")
        page.put(message(status, Header(0, 5, "drone"), "drone/@status"))
        for source, told in (("drone/cam", True), ("other/cam", False)):
            image = page.picture(source)
            assert image is not None
            assert changed(image, slice(105, 120), slice(0, 160)) is told


def test_many_frames_take_no_memory() -> None:
    """Old ones go, and what was found in them."""
    with CameraPage("127.0.0.1:0") as page:
        for stamp in range(50):
            one = frame(stamp)
            fed(page, one)
            page.put(message(boxes(one), one.header, "drone/detector"))
        camera = page._cameras["drone/cam"]
        assert len(camera.frames) == len(camera.found) == 8


def test_a_browser_gets_a_page_and_pictures() -> None:
    """The page names the cameras; each is a stream of JPEG; another camera is not found."""
    with CameraPage("127.0.0.1:0") as page:
        assert b"no picture yet" in get(page, "/")[1]
        fed(page, frame(1))
        status, text = get(page, "/")
        assert status == 200
        assert b'src="/camera/drone/cam"' in text
        status, data = get(page, "/camera/drone/cam", parts=2)
        assert status == 200
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        assert image.shape == (120, 160, 3)
        assert get(page, "/camera/none")[0] == 404


def test_an_address_that_cannot_be_had_is_told() -> None:
    """None, and one in use."""
    with pytest.raises(ConfigError, match="host:port"):
        CameraPage("here")
    with (
        CameraPage("127.0.0.1:0") as page,
        pytest.raises(ConfigError, match="--view-address"),
    ):
        CameraPage(f"127.0.0.1:{page.port}")
