"""Angles of gimbals: what a levelled camera sees, whatever the vehicle's attitude."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.dataflow.mission_document import NavigationDocument
from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.actions import AimGimbal
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import GimbalAttitude, levelled
from aerodaas.messages.waypoints import Waypoint

CAMERA = CameraModel.from_fov(64, 48, 1.0)
tilts = st.floats(-0.6, 0.6)
turns = st.floats(-math.pi, math.pi)


@given(tilts, tilts, turns, st.floats(-math.pi / 2, math.pi / 2), turns)
def test_the_optical_axis_is_where_the_gimbal_says(
    roll: float, pitch: float, yaw: float, look: float, aside: float
) -> None:
    """In the world: `look` above the horizon, `aside` to the left of the nose; and upright."""
    vehicle = Odometry(np.zeros(3), np.zeros(3), yaw, roll, pitch)
    camera = levelled(CAMERA, GimbalAttitude(0, look, aside), vehicle)
    body = rotation_from_rpy(roll, pitch, yaw)
    axes = body @ camera.body_from_optical
    bearing = yaw + aside
    ahead = [math.cos(bearing) * math.cos(look), math.sin(bearing) * math.cos(look), math.sin(look)]
    assert np.allclose(axes[:, 2], ahead, atol=1e-6)
    assert abs(axes[2, 0]) < 1e-6, "the picture's rows are level"
    assert axes[2, 1] <= 1e-6, "its lower edge is below"


def test_nadir_has_the_top_of_the_picture_ahead() -> None:
    """As a surveyor has it: the nose is at the upper edge."""
    vehicle = Odometry(np.zeros(3), np.zeros(3), 0.0)
    camera = levelled(CAMERA, GimbalAttitude(0, -math.pi / 2, 0.0), vehicle)
    right, down, ahead = camera.body_from_optical.T
    assert np.allclose(ahead, [0, 0, -1], atol=1e-9)
    assert np.allclose(down, [-1, 0, 0], atol=1e-9)
    assert np.allclose(right, [0, -1, 0], atol=1e-9)


def test_a_waypoint_says_where_the_gimbal_looks() -> None:
    """One angle leaves the other at zero; none leaves the gimbal."""
    assert Waypoint("a", 0, 0, 2).actions == ()
    assert Waypoint("a", 0, 0, 2, gimbal_pitch=-1.0).actions == (AimGimbal(-1.0, 0.0),)
    assert Waypoint("a", 0, 0, 2, gimbal_yaw=0.5).actions == (AimGimbal(0.0, 0.5),)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"gimbal_pitch": -90}, "radians"),
        ({"gimbal_yaw": 45.0}, "radians"),
        ({"gimbal_pitch": math.nan}, "finite"),
        ({"photo": "yes"}, "True or False"),
        ({"video": 1}, "video must be True, False or None, not 1"),
        ({"zoom": 101}, "zoom is in percent, from 0 to 100"),
        ({"focus": -1}, "focus is in percent"),
        ({"zoom": float("nan")}, "zoom must be a finite number"),
    ],
)
def test_degrees_and_nonsense_are_refused(fields: dict[str, object], said: str) -> None:
    """By the name of the field."""
    with pytest.raises(InvalidWaypointError, match=said):
        Waypoint("a", 0, 0, 2, **fields)  # type: ignore[arg-type]


def test_a_mission_document_holds_it() -> None:
    """The same waypoint comes back, and one without says nothing of it."""
    waypoint = Waypoint(
        "a", 0, 0, 2, gimbal_pitch=-1.0, gimbal_yaw=0.5, zoom=5, focus=80, photo=True, video=False
    )
    navigation = NavigationDocument(robot="drone", waypoints=[waypoint])
    text = navigation.model_dump_json(exclude_defaults=True)
    assert NavigationDocument.model_validate_json(text).waypoints == [waypoint]
    assert "trigger" not in text
