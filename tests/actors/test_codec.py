"""Messages survive the way through bytes, and large arrays are not copied."""

from __future__ import annotations

import dataclasses
import enum
from collections import OrderedDict
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from aerodaas import AeroNavigation, NavigationType, Waypoint
from aerodaas.actors.streams.codec import Encoded, decode
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert


class Colour(enum.Enum):
    """Members whose values are told."""

    RED = (1, "red")
    BLUE = (2, "blue")


class Pair(NamedTuple):
    """A named tuple."""

    first: Any
    second: Any


@dataclass(frozen=True)
class Finding:
    """What an application's analysis might find, with an array and a number of NumPy's."""

    place: Any
    values: dict[str, Any] = field(default_factory=dict)


class Slotted:
    """A class without a `__dict__`."""

    __slots__ = ("value",)

    def __init__(self, value: int) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Slotted) and other.value == self.value

    __hash__ = None  # type: ignore[assignment]


class Numbers(list[int]):
    """A list with an attribute."""

    name = ""


_FLOATS = st.floats(allow_nan=False)
_ARRAYS = arrays.arrays(
    st.sampled_from([np.dtype(kind) for kind in ("?", "u1", "f4", "<f8", ">f8", "i8", "c16")]),
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=9),
    elements={"allow_nan": False},
)
_VECTORS = arrays.arrays(np.float64, 3, elements=_FLOATS)
_POINTS = arrays.arrays(
    np.float32, st.tuples(st.integers(0, 40), st.just(3)), elements={"allow_nan": False}
)
_HEADERS = st.builds(Header, st.integers(), st.integers(), st.text())
_SCALARS = st.one_of(
    _FLOATS.map(np.float64), st.integers(-5, 5).map(np.int32), st.booleans().map(np.bool_)
)
_ATOMS = st.one_of(
    st.none(), st.booleans(), st.integers(), _FLOATS, st.text(), st.binary(), _SCALARS, _ARRAYS
)
_RECORDS = st.one_of(
    _HEADERS,
    st.builds(Odometry, _VECTORS, _VECTORS, _FLOATS),
    st.builds(Detection, st.tuples(*[_FLOATS] * 4), st.text(), st.just(0.5), keypoints=_POINTS),
    st.builds(Detections, _HEADERS, st.just(()), st.just(6), st.just(4), nearest=_ARRAYS),
    st.sampled_from([*Colour, *MissionState, *NavigationType]),
)
_ITEMS = st.recursive(
    _ATOMS | _RECORDS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.lists(inner, max_size=4).map(tuple),
        st.dictionaries(st.text(max_size=5), inner, max_size=4),
        st.builds(Pair, inner, inner),
        st.builds(Finding, inner, st.dictionaries(st.text(max_size=3), inner, max_size=2)),
    ),
    max_leaves=12,
)


def _message(item: object) -> Message[object]:
    return Message("s", 3, 5, Header(1, 2, "cam"), 7, (TraceSpan("a", 1, 2),), item)


@given(
    st.lists(
        arrays.arrays(
            st.sampled_from([np.dtype(kind) for kind in ("u1", "f4", "<f8", ">f8", "i8")]),
            arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=40),
        ),
        max_size=4,
    )
)
def test_arrays_of_any_shape_come_back_equal(items: list[NDArray[Any]]) -> None:
    """Encoding and decoding is the identity."""
    restored = decode(memoryview(Encoded(_message(items)).to_bytes()))
    assert restored.spans == (TraceSpan("a", 1, 2),)
    assert isinstance(restored.item, list)
    for before, after in zip(items, restored.item, strict=True):
        np.testing.assert_array_equal(before, after)
        assert before.dtype == after.dtype


@pytest.mark.parametrize("vector", [np.array([1.0, -2.5, np.nan]), np.arange(6.0)[::2]])
def test_a_short_vector_costs_little_and_is_read_only(vector: NDArray[np.float64]) -> None:
    """Of 24 bytes it needs no buffer with its alignment; nobody changes it for the others."""
    encoded = Encoded(_message(vector))
    assert encoded.size < Encoded(_message(None)).size + 100
    restored = decode(memoryview(encoded.to_bytes())).item
    assert isinstance(restored, np.ndarray)
    np.testing.assert_array_equal(restored, vector)
    with pytest.raises(ValueError, match="read-only"):
        restored[0] = 1.0


def test_a_frame_is_a_view_of_the_buffer_and_read_only() -> None:
    """A reader neither copies a picture nor can it spoil it for the others."""
    image = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)
    whole = bytearray(Encoded(_message(Frame(Header(0, 0, "c"), image))).to_bytes())
    frame = decode(memoryview(whole)).item
    assert isinstance(frame, Frame)
    whole[-1] ^= 0xFF
    assert frame.image[-1, -1, -1] == image[-1, -1, -1] ^ 0xFF
    with pytest.raises(ValueError, match="read-only"):
        frame.image[0, 0, 0] = 1


def _there_and_back(item: object) -> Any:  # noqa: ANN401 - any item
    return decode(memoryview(Encoded(_message(item)).to_bytes())).item


def _same(one: Any, other: Any) -> bool:  # noqa: ANN401 - any items
    """Whether both are alike, to the types of their numbers and the parts of their parts."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other) and one.shape == other.shape
    if isinstance(one, dict):
        return list(one) == list(other) and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if dataclasses.is_dataclass(one):
        names = [each.name for each in dataclasses.fields(one)]
        return all(_same(getattr(one, name), getattr(other, name)) for name in names)
    return bool(one == other)


@given(_ITEMS)
def test_what_comes_back_is_what_went(item: object) -> None:
    """Numbers, arrays, records, and whatever is made of them."""
    assert _same(_there_and_back(item), item)


@pytest.mark.parametrize(
    "item",
    [
        Slotted(3),
        Numbers([1, 2]),
        OrderedDict(b=1, a=2),
        Fraction(1, 3),
        {1, 2},
        list(range(1000)),
        np.array(["text"]),
        np.datetime64("2026-01-01"),
        lambda: None,
        ValueError("x"),
    ],
)
def test_an_object_of_any_class_arrives(item: Any) -> None:  # noqa: ANN401 - any item
    """Slots, sets, functions, arrays of no numbers: whatever pickle or cloudpickle can hold."""
    found = _there_and_back([Finding(item)])[0].place
    assert type(found) is type(item)
    if not isinstance(item, ValueError) and not callable(item):
        assert np.array_equal(found, item) if isinstance(item, np.ndarray) else found == item


def test_navigation_arrives_as_it_was() -> None:
    """The item of the hop that ends in a setpoint."""
    sent = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [Waypoint("a", 1, 2, 3)], priority=2)
    found = _there_and_back(sent)
    assert type(found) is AeroNavigation
    assert list(found) == list(sent)
    assert (found.navigation_type, found.scheduling_type, found.priority, found.stream) == (
        NavigationType.ANALYTICS_DRIVEN,
        sent.scheduling_type,
        2,
        None,
    )


def test_what_comes_again_and_again_is_found_again() -> None:
    """A status names the same waypoints, a frame the same camera: each is in memory once."""
    camera = CameraModel.from_fov(64, 48, 1.2, mount=(0.1, 0.0, 0.0))
    detections = Detections(Header(0, 0, "c"), (), 64, 48, camera)
    one, other = _there_and_back(detections), _there_and_back(detections)
    assert one.camera == camera
    assert one.camera is other.camera
    waypoint = Waypoint("a", 1, 2, 3)
    assert _there_and_back([waypoint])[0] is _there_and_back((waypoint,))[0]


def test_an_alert_holds_whatever_figures_it_was_given() -> None:
    """Its values are of any type."""
    alert = Alert(Header(0, 0, "c"), "kind", "text", {"a": np.float32(0.5), "b": [1, None]})
    assert _same(_there_and_back(alert), alert)
