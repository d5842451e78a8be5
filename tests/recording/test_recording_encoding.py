"""JSON that every reader takes, topics that every tool takes, quaternions that are rotations."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from enum import Enum, Flag
from pathlib import PurePosixPath
from typing import NamedTuple

import numpy as np
import pytest
from filled import filled
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import BaseModel

from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.encoding import plain, stream_of, topic
from aerodaas.recording.reference_frames import OPTICAL, Rotation, compose, from_rpy

ANGLES = st.floats(-math.pi, math.pi)
ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | st.binary()
    | st.builds(object)
    | st.builds(lambda n: np.full(3, n), st.floats()),
    lambda inner: (
        st.lists(inner)
        | st.tuples(inner)
        | st.dictionaries(st.text() | st.integers() | st.tuples(st.integers()), inner)
    ),
    max_leaves=20,
)


@given(ANYTHING)
def test_anything_becomes_strict_json(value: object) -> None:
    """No value is refused, and none becomes what other readers refuse."""
    json.dumps(plain({"value": value}), allow_nan=False)


def test_cycles_and_large_arrays_stay_small() -> None:
    """Whatever a plug-in sends, the recording does not explode."""
    cycle: list[object] = []
    cycle.append(cycle)
    assert len(json.dumps(plain(cycle))) < 1000
    assert plain(np.zeros((1000, 1000))) == {"shape": [1000, 1000], "dtype": "float64"}


@pytest.mark.parametrize(
    ("stream", "kind", "name"),
    [
        ("tello/cam", "image", "/tello/cam/image"),
        ("/tello/cam/", "image", "/tello/cam/image"),
        ("tello/a b..c", "image", "/tello/a_b_c/image"),
        ("tello/image", "image", "/tello/image"),
        ("tello/@state", "state", "/tello/state"),
        ("tello/@state", "odometry", "/tello/state/odometry"),
        ("tello/state", "state", "/tello/own.state/state"),
        ("tello/setpoints", "value", "/tello/own.setpoints/value"),
        ("tello/statement", "value", "/tello/statement/value"),
        ("state", "state", "/state"),
        ("state", "value", "/state/value"),
    ],
)
def test_topics_keep_the_projects_own_streams_apart(stream: str, kind: str, name: str) -> None:
    """A robot's sensor may be called as its states are; it is recorded beside them."""
    assert topic(stream, kind) == name
    if "@" not in stream and "." not in stream and stream.rpartition("/")[2] != kind:
        assert stream_of(name.removesuffix(f"/{kind}")) == stream.strip("/").replace(" ", "_")


class Colour(Enum):
    """An enumeration."""

    RED = 1


class Mark(Flag):
    """Flags."""

    ONE = 1
    TWO = 2


class Pair(NamedTuple):
    """A named tuple."""

    left: int
    right: float


@dataclass
class Record:
    """A dataclass."""

    name: str
    inner: object = None


class Slots:
    """An object without a dictionary; one of its fields was never set."""

    __slots__ = ("absent", "at")

    def __init__(self) -> None:
        self.at = 3


class OneSlot:
    """An object whose only field is named by a text."""

    __slots__ = "speed"  # noqa: PLC0205 - as some write it

    def __init__(self) -> None:
        self.speed = 2.5


class Open:
    """An object with a dictionary."""

    def __init__(self) -> None:
        self.speed = 2.5
        self.__dict__["__hidden__"] = 1


class Dumps:
    """An object that says itself what it consists of."""

    def __init__(self, data: object) -> None:
        self.data = data

    def get_data(self) -> object:
        """Say it."""
        return self.data


class Refuses:
    """An object that fails when asked."""

    @property
    def __dict__(self) -> dict[str, object]:  # type: ignore[override]
        """Fail."""
        raise RuntimeError

    def __str__(self) -> str:
        raise RuntimeError


class Model(BaseModel):
    """A model of pydantic's."""

    speed: float = 1.5


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (np.bool_(1), True),
        (np.int64(-3), -3),
        (np.float32(0.5), 0.5),
        (np.float64("nan"), None),
        (math.inf, None),
        (Colour.RED, "RED"),
        (Mark.ONE | Mark.TWO, "ONE|TWO"),
        (Pair(1, math.nan), {"left": 1, "right": None}),
        (Record("a", Pair(1, 2)), {"name": "a", "inner": {"left": 1, "right": 2}}),
        (Slots(), {"at": 3}),
        (OneSlot(), {"speed": 2.5}),
        (Open(), {"speed": 2.5}),
        (Dumps({"a": 1}), {"a": 1}),
        (Dumps([1, 2]), {"data": [1, 2]}),
        (Model(), {"speed": 1.5}),
        (Refuses(), "<Refuses>"),
        (Colour, "<Colour>"),
        (object(), "<object>"),
        (PurePosixPath("/a/b"), "/a/b"),
        ({1: "a", None: "b"}, {"1": "a", "None": "b"}),
        ({3}, [3]),
        (frozenset(), []),
        ((1, (2,)), [1, [2]]),
        (np.array([True, False]), [True, False]),
        (np.array([1.0, np.nan]), [1.0, None]),
        (np.zeros(0), []),
        (np.array(["a"]), {"shape": [1], "dtype": "<U1"}),
    ],
)
def test_what_objects_become(value: object, found: object) -> None:
    """Fields where there are any, names of members and classes, or else the words for it."""
    back = plain(value)
    assert back == found
    assert type(back) is type(found)


def test_a_secret_is_recorded_nowhere() -> None:
    """A vehicle's state in an item of an application's own class: its video's address is none."""
    state = filled(VehicleState, video="rtsp://me:password@10.0.0.2")
    found = plain({"seen": [state]})
    assert found["seen"][0]["armed"] is True
    assert "password" not in str(found)


def matrix(rotation: Rotation) -> NDArray[np.float64]:
    """Rotation matrix of a unit quaternion."""
    x, y, z, w = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@given(ANGLES, ANGLES, ANGLES)
def test_quaternion_is_the_rotation(roll: float, pitch: float, yaw: float) -> None:
    """Foxglove sees the attitude that `geometry` computes with."""
    found = matrix(from_rpy(roll, pitch, yaw))
    assert np.allclose(found, rotation_from_rpy(roll, pitch, yaw), atol=1e-12)


@given(ANGLES, ANGLES)
def test_camera_mount_is_the_rotation(pitch: float, yaw: float) -> None:
    """Foxglove's camera looks where ours looks."""
    camera = CameraModel.from_fov(640, 480, 1.0, pitch=pitch, yaw=yaw)
    found = matrix(compose(from_rpy(0.0, pitch, yaw), OPTICAL))
    assert np.allclose(found, camera.body_from_optical, atol=1e-12)
