"""Items over the wire: what is written is read again, and nothing else is."""

from __future__ import annotations

import contextlib
import enum
import json
import random
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from filled import filled, names
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from aerodaas.analytics.wire_items import WIRE_CLASSES, UnknownClassError, pack, unpack
from aerodaas.cameras.picture_size import MAX_PIXELS
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.messages.serialization.schema import MessageError, json_of
from aerodaas.messages.vehicle import VehicleState
from aerodaas.messages.waypoints import (
    NavigationType,
    SchedulingType,
    VelocityCommand,
    Waypoint,
    WaypointType,
)

floats = st.floats(allow_subnormal=False, allow_infinity=False)
real = st.floats(-1e9, 1e9, allow_subnormal=False)
words = st.text(min_size=1, max_size=8)
stamps = st.integers(0, 2**62)
headers = st.builds(Header, st.integers(0, 2**40), stamps, words)
vectors = hnp.arrays(np.float64, 3, elements=floats)
odometry = st.builds(Odometry, vectors, vectors, floats, roll=floats, pitch=floats)
cameras = st.builds(CameraModel, *[st.integers(1, 4000)] * 2, *[real] * 4)
waypoints = st.builds(
    Waypoint,
    words,
    *[st.floats(-80, 80)] * 3,
    waypoint_type=st.sampled_from(WaypointType),
    yaw=st.none() | real,
    speed=st.none() | st.floats(0.1, 9),
    deadline=st.none() | real,
)
commands = st.builds(VelocityCommand, *[st.floats(-5, 5)] * 4)
plain = st.none() | st.booleans() | st.integers(-(2**70), 2**70) | st.floats() | st.text(max_size=9)
hidden = st.builds(OpaqueItem, st.just("Own"), st.none() | st.text(max_size=4), st.binary())
known = [filled(one) for one in WIRE_CLASSES.values() if one is not VehicleState]
known.append(filled(VehicleState, video=""))
items: st.SearchStrategy[object] = st.one_of(
    plain, hidden, odometry, waypoints, st.sampled_from(known)
)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Small frames, some of them with depth."""
    height, width = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    image = draw(hnp.arrays(np.uint8, (height, width, 3)))
    depth = draw(st.none() | hnp.arrays(np.uint16, (height, width)))
    return Frame(draw(headers), image, draw(st.none() | cameras), draw(st.none() | odometry), depth)


JPEG = b"\xff\xd8"
PNG = b"\x89PNG"


def sent(item: object, *, lossless: bool = False) -> tuple[Any, bytes]:
    """An item as it arrives: its JSON is strict."""
    content, blob = pack(item, lossless=lossless)
    return json.loads(json.dumps(content, allow_nan=False)), blob


@given(items)
def test_an_item_is_read_as_it_was_written(item: object) -> None:
    """To the last digit, with numbers that JSON does not have."""
    content, blob = sent(item)
    found = unpack(content, blob)
    assert type(found) is type(item)
    assert found == item or (found != found and item != item)  # noqa: PLR0124 - NaN
    assert not blob


LEFT_OUT = {(VehicleState, "video")}
"""Fields that stay where they are: that one may hold a password."""


@pytest.mark.parametrize("kind", WIRE_CLASSES.values(), ids=str)
def test_each_field_of_a_known_class_comes_back(kind: type) -> None:
    """But for what is left out on purpose, which has its default again."""
    item = filled(kind)
    found = unpack(*sent(item))
    for name in names(kind):
        value = found.__getattribute__(name)
        if (kind, name) in LEFT_OUT:
            assert not value
        else:
            assert repr(value) == repr(getattr(item, name)), name


@given(frames())
def test_a_lossless_frame_is_read_as_it_was_written(frame: Frame) -> None:
    """Its pixels, depth, header and camera."""
    assert unpack(*sent(frame, lossless=True)) == frame


@given(frames())
def test_a_frame_as_jpeg_keeps_all_but_its_pixels(frame: Frame) -> None:
    """Depth is never lossy."""
    content, blob = sent(frame)
    assert blob.startswith(JPEG)
    found = unpack(content, blob)
    assert found.image.shape == frame.image.shape
    for name in ("header", "camera", "odometry"):
        assert getattr(found, name) == getattr(frame, name)
    assert (found.depth is None) == (frame.depth is None)
    if frame.depth is not None:
        np.testing.assert_array_equal(found.depth, frame.depth)


def test_a_grey_frame_is_grey_as_jpeg() -> None:
    """What a compressed picture shows is what was written, within a few shades."""
    image = np.tile(np.arange(0, 256, 4, dtype=np.uint8)[:, None, None], (1, 64, 3))
    found = unpack(*sent(Frame(Header(1, 2, "cam"), image)))
    assert np.abs(found.image.astype(int) - image).max() < 8


@given(
    st.lists(waypoints | commands, max_size=3, unique_by=lambda one: getattr(one, "id", id(one)))
)
def test_navigation_is_read_as_it_was_written(given_items: list[Any]) -> None:
    """With its type, order and priority."""
    kind = NavigationType.ANALYTICS_DRIVEN
    navigation = AeroNavigation(kind, given_items, SchedulingType.UNORDERED, priority=2)
    found = unpack(*sent(navigation))
    assert list(found) == list(navigation)
    assert (found.navigation_type, found.priority) == (kind, 2)
    assert found.scheduling_type is SchedulingType.UNORDERED


def test_each_field_of_navigation_and_of_a_frame_comes_back() -> None:
    """Numbers that JSON does not have included, within whatever they hold."""
    given_items = [filled(Waypoint), filled(VelocityCommand)]
    assert list(unpack(*sent(AeroNavigation(data=given_items)))) == given_items
    leaning = filled(Odometry, roll=float("nan"))
    frame = filled(Frame, odometry=leaning)
    assert unpack(*sent(frame, lossless=True)) == frame


class Own:
    """A class of somebody's own."""


class Seen(NamedTuple):
    """A result of somebody's own class, which is a tuple."""

    number: int


class Level(str, enum.Enum):
    """A result of somebody's own class, which is a text."""

    HIGH = "high"


class Corner(Waypoint):
    """A waypoint of somebody's own class."""


@pytest.mark.parametrize(
    "item",
    [
        *(Own(), [1], (1,), {"a": 1}, b"x", np.zeros(2), Readings, object()),
        *(Seen(2), Level.HIGH, MissionState.ENROUTE, Corner("a", 1, 2, 3)),
        AeroNavigation(data=[Corner("a", 1, 2, 3)]),
    ],
    ids=lambda item: type(item).__name__,
)
def test_no_other_class_goes_over_the_wire(item: object) -> None:
    """It is refused, and never pickled: its class would be lost on the way."""
    with pytest.raises(UnknownClassError, match="no class that goes over the wire"):
        pack(item)


NAVIGATION = {"items": [], "type": "analytics_driven", "scheduling": "ordered", "priority": None}
ALERT = json_of(Alert(Header(3, 4, "drone/cam"), "a", "b"))


def deep(levels: int) -> Any:  # noqa: ANN401 - JSON
    """Lists in lists."""
    content: Any = 1
    for _ in range(levels):
        content = [content]
    return content


@pytest.mark.parametrize(
    "content",
    [
        {"is": "Popen", "of": {"args": "true"}},
        {"is": "Waypoint", "of": {"id": "a", "x": float("nan"), "y": 0, "z": 0}},
        {"is": "Waypoint", "of": {"id": "a", "x": 10**400, "y": 0, "z": 0}},
        {"is": "Waypoint", "of": {"id": "a", "x": "1", "y": 0, "z": 0}},
        {"is": "Waypoint", "of": {"id": "a", "x": 1, "y": 0, "z": 0, "__class__": 1}},
        {"is": "Waypoint", "of": {}},
        {"is": "AeroNavigation", "of": [1.0]},
        {"is": "AeroNavigation", "of": {**NAVIGATION, "items": [1.0]}},
        {"is": "AeroNavigation", "of": {**NAVIGATION, "items": [{"id": "a"}]}},
        {"is": "AeroNavigation", "of": {**NAVIGATION, "priority": 1.5}},
        {"is": "AeroNavigation", "of": {**NAVIGATION, "type": "aimless"}},
        {"is": "AeroNavigation"},
        {"is": "OpaqueItem", "of": {"kind": "a", "value": 1, "data": "?"}},
        {"is": "OpaqueItem", "of": {"kind": "a", "value": deep(40), "data": ""}},
        {"is": "float", "of": "1"},
        {"is": "float", "of": []},
        {"is": "Readings", "of": {"stamp": 1, "values": {"a": []}}},
        [0] * 200_000,
        {"is": []},
        deep(40),
        {
            "is": "Alert",
            "of": {
                **json_of(Alert(Header(3, 4, "drone/cam"), "a", "b")),
                "values": {"a": [0] * 200_000},
            },
        },
    ],
)
def test_malformed_items_are_refused(content: object) -> None:
    """By one error."""
    with pytest.raises(MessageError):
        unpack(content)


@given(items | frames(), st.randoms(use_true_random=False))
@settings(max_examples=300)
def test_a_damaged_item_is_refused_or_another_item(item: object, rng: random.Random) -> None:
    """Whatever arrives: an item, or MessageError."""
    content, blob = sent(item, lossless=rng.random() < 0.5)
    places = list(_places({"": content}))
    holder, key = rng.choice(places)
    holder[key] = rng.choice([None, -1, 1e300, "x", [], {}, {"is": "tuple"}, rng.choice(places)[1]])
    if blob and rng.random() < 0.5:
        changed = bytearray(blob)
        changed[rng.randrange(len(blob))] ^= 1 << rng.randrange(8)
        blob = bytes(changed[: rng.randrange(len(blob) + 1)])
    with contextlib.suppress(MessageError):
        unpack(content, blob)


def _places(content: Any) -> Iterator[tuple[Any, Any]]:  # noqa: ANN401 - JSON
    if isinstance(content, dict | list):
        for key in content if isinstance(content, dict) else range(len(content)):
            yield content, key
            yield from _places(content[key])


FRAME = Frame(Header(1, 2, "cam"), np.zeros((4, 6, 3), np.uint8), depth=np.ones((4, 6), np.uint16))


def wide(content: dict[str, Any], blob: bytes) -> bytes:
    """A picture that claims to be huge."""
    del content
    side = 1 << 13
    sides = b"".join(one.to_bytes(4, "big") for one in (side, MAX_PIXELS // side + 1))
    return blob[:16] + sides + blob[24:]


def bmp(content: dict[str, Any], blob: bytes) -> bytes:
    """A picture of a format that no frame has."""
    del blob
    data = cv2.imencode(".bmp", FRAME.image)[1].tobytes()
    content["of"]["picture"] = len(data)
    return data


def depth(image: np.ndarray[Any, Any]) -> Callable[[dict[str, Any], bytes], bytes]:
    """The frame with another depth."""

    def change(content: dict[str, Any], blob: bytes) -> bytes:
        return blob[: content["of"]["picture"]] + cv2.imencode(".png", image)[1].tobytes()

    return change


def told(**words: object) -> Callable[[dict[str, Any], bytes], bytes]:
    """The frame with other parts."""

    def change(content: dict[str, Any], blob: bytes) -> bytes:
        content["of"].update(words)
        return blob

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (wide, "too large"),
        (bmp, "no jpeg or png"),
        (depth(np.zeros((4, 6), np.uint8)), "16 bits"),
        (depth(np.zeros((4, 7), np.uint16)), "of its size"),
        (told(picture=3), "no jpeg or png"),
        (told(picture=-1), "16 bits"),
        (told(picture=2**70), "picture: Input should"),
        (told(header=None), r"header: Input should be"),
        (told(pickle="x"), "pickle: Unexpected"),
        (lambda _, blob: blob[:60] + b"\0" * (len(blob) - 60), "damaged|16 bits"),
    ],
)
def test_a_malformed_frame_is_refused(
    change: Callable[[dict[str, Any], bytes], bytes], said: str
) -> None:
    """Before anything large is decoded."""
    content, blob = sent(FRAME, lossless=True)
    blob = change(content, blob)
    with pytest.raises(MessageError, match=said):
        unpack(content, blob)


def test_bytes_beside_what_is_no_picture_are_refused() -> None:
    """They would have to be something."""
    with pytest.raises(MessageError, match="no frame"):
        unpack(5, b"x")
