"""Angles of gimbals: what a levelled camera sees, whatever the vehicle's attitude."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import GimbalAttitude, levelled

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
