"""A camera's pictures in each form that a live view may ask for."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import av
import cv2
import numpy as np
import pytest
from av.video.frame import VideoFrame
from grounds import ground

from aerodaas.analytics.wire_items import unpack
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import FollowedTarget, NavigationType, TargetState, VelocityCommand
from aerodaas.protocol.live import ItemMessage
from aerodaas.protocol.schemas import PictureForm
from aerodaas.service.live.packed_reader import PackedReader, ground_of
from aerodaas.terrain.ground import Ground

SOURCE = "drone/cam"
SECOND = 10**9


def frame(number: int, stamp: int, width: int = 64, *, depth: bool = False) -> Frame:
    """One whose grey tells its number."""
    measured = np.full((48, width), 3000, np.uint16) if depth else None
    image = np.full((48, width, 3), 20 + 10 * number, np.uint8)
    return Frame(Header(number, stamp, SOURCE), image, depth=measured)


class Stream:
    """Items that come at once, and then none."""

    def __init__(self, *items: Any) -> None:  # noqa: ANN401 - of any stream
        self._items: Iterator[Any] = iter(items)

    def next_message(self, timeout: float) -> Message[Any]:
        """The next item."""
        del timeout
        item = next(self._items)
        return Message(SOURCE, item.header.id, item.header.stamp, item.header, 0, (), item)


def packed(form: PictureForm, *items: Any) -> list[tuple[dict[str, Any], bytes]]:  # noqa: ANN401
    """What a watcher gets of these."""
    reader = PackedReader(Stream(*items), SOURCE, form)
    found = [found for _ in items if (found := reader.next_packed(0.1)) is not None]
    if form is not PictureForm.WHOLE:
        for message, _ in found:
            if message["kind"] == "item":
                require_declared(message)
    return found


def require_declared(message: dict[str, Any]) -> None:
    """Require that a page's message is what the wire's schema says of it."""
    told = ItemMessage.model_validate_json(json.dumps(message)).item
    assert message.keys() - {"seq"} <= ItemMessage.model_fields.keys()
    fields = {one.alias or name for name, one in type(told).model_fields.items()}
    assert message["item"].keys() == fields


def greys(data: list[bytes]) -> list[int]:
    """The numbers that a video's greys tell."""
    decoder = av.CodecContext.create("h264", "r")
    found: list[VideoFrame] = []
    for part in [*map(av.Packet, data), None]:
        found += [one for one in decoder.decode(part) if isinstance(one, VideoFrame)]
    return [round((float(one.to_ndarray(format="gray").mean()) - 20) / 10) for one in found]


def test_programs_get_whole_frames() -> None:
    """With depth, to the millimetre."""
    ((message, blob),) = packed(PictureForm.WHOLE, frame(1, 0, depth=True))
    item = unpack(message["item"], blob)
    assert (item.depth == 3000).all()


@pytest.mark.parametrize("form", [PictureForm.JPEG, PictureForm.H264])
@pytest.mark.parametrize("depth", [True, False])
def test_a_page_is_told_of_depth_but_gets_the_picture_alone(
    form: PictureForm, *, depth: bool
) -> None:
    """Its blob is one picture."""
    ((message, blob),) = packed(form, frame(1, 0, depth=depth))
    assert message["item"]["depth"] is depth
    assert message["item"]["format"] == form.value
    assert message["item"]["bytes"] == [len(blob)]
    if form is PictureForm.JPEG:
        image = cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_COLOR)
        assert np.asarray(image).mean() == pytest.approx(30, abs=1)


def test_a_video_can_be_entered_each_second_and_each_part_is_one_picture() -> None:
    """Ten pictures a second for three seconds; each can be shown as soon as it has come."""
    pictures = [frame(number % 20, number * SECOND // 10) for number in range(30)]
    found = packed(PictureForm.H264, *pictures)
    keys = [number for number, (message, _) in enumerate(found) if message["key"]]
    assert keys == [0, 10, 20]
    for begin in keys:
        parts = [blob for _, blob in found[begin : begin + 10]]
        assert greys(parts) == [number % 20 for number in range(begin, begin + 10)]


def test_a_video_of_another_size_begins_anew() -> None:
    """As a camera that is switched to another mode."""
    found = packed(PictureForm.H264, frame(0, 0), frame(1, 1), frame(2, 2, 80), frame(3, 3, 80))
    assert [message["key"] for message, _ in found] == [True, False, True, False]


def test_depth_is_sent_alone_and_only_where_it_was_measured() -> None:
    """Nothing else of a stream comes beside it."""
    measured = frame(1, 5, depth=True)
    found = Detections.of(measured, [Detection((1, 2, 3, 4), "person", 0.5)])
    ((message, blob),) = packed(PictureForm.DEPTH, frame(0, 4), measured, found)
    assert message["item"]["is"] == "Depth"
    assert message["item"]["header"]["stamp"] == 5
    assert message["item"]["range"] == 3.0
    assert message["item"]["bytes"] == [len(blob)]


def test_a_page_is_told_of_a_person_whose_clothes_can_be_told() -> None:
    """As any that is near enough."""
    image = np.zeros((200, 200, 3), np.uint8)
    image[:100, 80:120] = 60, 120, 200
    image[100:, 80:120] = 30, 30, 90
    shown = Detections.of(
        Frame(Header(1, 2, SOURCE), image), [Detection((80, 10, 120, 190), "person", 0.9)]
    )
    assert shown[0].appearance is not None
    ((message, _),) = packed(PictureForm.JPEG, shown)
    assert unpack(message["item"]) == shown


def test_a_page_is_told_what_is_followed_in_a_frame_and_nothing_else_of_commands() -> None:
    """With the header of the frame that the command was made from; programs get the command."""
    made = Header(7, 5, SOURCE)
    target = FollowedTarget(TargetState.SURE, (1.0, 2.0, 3.0, 4.0), 9)
    commands = [
        AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(0.2, target=one)])
        for one in (None, target)
    ]

    class Commands:
        """As they come."""

        def __init__(self) -> None:
            self._left = iter(commands)

        def next_message(self, timeout: float) -> Message[Any]:
            """The next one."""
            del timeout
            return Message("follower", 1, 6, made, 0, (), next(self._left))

    for form in (PictureForm.JPEG, PictureForm.H264):
        reader = PackedReader(Commands(), "follower", form)
        assert reader.next_packed(0.1) is None
        found = reader.next_packed(0.1)
        assert found is not None
        item = found[0]["item"]
        assert item["header"] == {"id": 7, "stamp": 5, "source": SOURCE}
        assert (item["is"], item["of"]["state"]) == ("Target", "sure")
        assert item["of"]["box"] == [1.0, 2.0, 3.0, 4.0]
    reader = PackedReader(Commands(), "follower", PictureForm.WHOLE)
    whole = [reader.next_packed(0.1) for _ in commands]
    assert [unpack(one[0]["item"], one[1]).commands[0] for one in whole if one] == [
        one.commands[0] for one in commands
    ]
    assert PackedReader(Commands(), "follower", PictureForm.DEPTH).next_packed(0.1) is None


class Strange:
    """A result of a plug-in's own class."""

    header = Header(3, 5, SOURCE)


def test_an_item_that_cannot_be_written_is_told_of() -> None:
    """In its place, and the next ones come: a stream of some of them goes on."""
    header = Header(3, 5, SOURCE)
    for form in (PictureForm.WHOLE, PictureForm.JPEG):
        (first, _), (second, _) = packed(form, Strange(), Detections(header, (), 64, 48))
        assert (first["kind"], first["stream"]) == ("left_out", SOURCE)
        assert first["reason"] == "Strange is of no class that goes over the wire, or holds one"
        assert (second["kind"], second["item"]["is"]) == ("item", "Detections")


PLATEAU = ground(lambda east, _: np.where(east > 10, 5.0, 0.0))
"""Five metres up, from a cliff east of home on."""


@pytest.mark.parametrize(("over", "up"), [(None, 0.0), (PLATEAU, 5.0)])
def test_a_page_is_told_where_what_was_found_stands(over: Ground | None, up: float) -> None:
    """On the terrain where there is one; programs get what they need to know it themselves."""
    pose = Odometry(np.array([30.0, 0.0, 25.0]), np.zeros(3), 0.0)
    camera = CameraModel.from_fov(64, 48, 1.0, pitch=np.pi / 2)
    seen = Frame(Header(1, 0, SOURCE), np.zeros((48, 64, 3), np.uint8), camera, pose)
    boxes = ((30.0, 10.0, 34.0, 24.0), (30.0, 20.0, 34.0, 48.0))
    found = Detections.of(seen, [Detection(box, "person", 0.9) for box in boxes])
    for form in (PictureForm.JPEG, PictureForm.H264):
        one = PackedReader(Stream(found), SOURCE, form, over).next_packed(0.1)
        assert one is not None
        place, cut = one[0]["places"]
        assert place[:3] == pytest.approx([30.0, 0.0, up], abs=0.01)
        assert cut is None
        assert len(unpack(one[0]["item"])) == 2
    ((message, _),) = packed(PictureForm.WHOLE, found)
    assert "places" not in message
    assert unpack(message["item"]).camera == camera
    assert packed(PictureForm.DEPTH, found) == []


def test_ground_that_is_not_known_at_home_is_the_plane() -> None:
    """As without a terrain: the flight's own refusal says why."""
    robots = [{"id": "drone"}]
    assert ground_of(EnvironmentConfig.model_validate({"robots": robots})) is None
    content = {
        "robots": robots,
        "home": {"latitude": 47.1, "longitude": 8.1},
        "terrain": {"files": ["nowhere.hgt"], "clearance": 1},
    }
    assert ground_of(EnvironmentConfig.model_validate(content)) is None
