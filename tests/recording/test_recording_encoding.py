"""JSON that every reader takes, topics that every tool takes, quaternions that are rotations."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.geometry import CameraModel, rotation_from_rpy
from aerodaas.recording.encoding import json_bytes, plain, topic
from aerodaas.recording.rotation import OPTICAL, Rotation, compose, from_rpy

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


def refuse(constant: str) -> None:
    """Foxglove's JSON knows no NaN."""
    pytest.fail(f"{constant} is no JSON")


@given(ANYTHING)
def test_anything_becomes_strict_json(value: object) -> None:
    """No value is refused, and none becomes what other readers refuse."""
    json.loads(json_bytes({"value": value}), parse_constant=refuse)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_are_exact(value: float) -> None:
    """A replay needs the last digit too."""
    assert json.loads(json_bytes({"value": value}))["value"] == value


def test_cycles_and_large_arrays_stay_small() -> None:
    """Whatever a plug-in sends, the recording does not explode."""
    cycle: list[object] = []
    cycle.append(cycle)
    assert len(json_bytes({"value": cycle})) < 1000
    assert plain(np.zeros((1000, 1000))) == {"shape": [1000, 1000], "dtype": "float64"}


@given(st.text(min_size=1), st.sampled_from(["image", "state"]))
def test_topics_are_clean(stream: str, kind: str) -> None:
    """A topic starts with a slash and has no dots or blanks."""
    assert re.fullmatch(r"/[A-Za-z0-9_/\-]*", topic(stream, kind).replace("/own.", "/"))


def test_topic_does_not_repeat_itself() -> None:
    """A stream named after what it carries is its own topic."""
    assert topic("tello/@state", "state") == "/tello/state"
    assert topic("tello/cam.1", "image") == "/tello/cam_1/image"


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
