"""The way to a target is free, or the drone stops before what stands in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.steering import Clearance, surfaces
from aerodaas.following.target import RelativeTarget
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry

LIMITS = FollowLimits()
CAMERA = CameraModel.from_fov(640, 360, math.radians(80), mount=(0.1, 0.05, 0.08), pitch=0.2)
FAR = RelativeTarget(0.0, 8.0)
INTERVAL = 0.2
STOP = 0.8
"""Metres from the body's centre."""


def pose(
    x: float = 0.0, y: float = 0.0, yaw: float = 0.0, *, roll: float = 0.0, pitch: float = 0.0
) -> Odometry:
    """At 1.5 m above home."""
    return Odometry(np.array([x, y, 1.5]), np.zeros(3), yaw, roll, pitch)


def clearance(*points: tuple[float, float], at: Odometry | None = None) -> Clearance:
    """One that has seen these, forward and left of the body."""
    made = Clearance(LIMITS, 1.2)
    made.see(np.array(points, float).reshape(-1, 2), at, INTERVAL)
    return made


@given(along=st.floats(0.05, 7.0), aside=st.floats(-3.0, 3.0), bearing=st.floats(-1.0, 1.0))
def test_a_drone_at_the_limit_stops_before_what_is_in_its_way(
    along: float, aside: float, bearing: float
) -> None:
    """Whatever its bearing; what is more than half a metre aside is not in its way."""
    c, s = math.cos(bearing), math.sin(bearing)
    point = (c * along - s * aside, s * along + c * aside)
    speed = clearance(point).speed(RelativeTarget(bearing, 8.0), None)
    if abs(aside) > 0.501:
        assert speed == math.inf
    elif abs(aside) < 0.499:
        reaction = LIMITS.reaction_time + INTERVAL
        room = max(0.0, along - STOP)
        assert speed * reaction + speed**2 / (2 * LIMITS.braking) <= room + 1e-6
        assert (speed > 1e-9) == (along > STOP + 1e-9)


@given(yaw=st.floats(-4, 4), forward=st.floats(0.0, 2.0), left=st.floats(-0.3, 0.3))
def test_surfaces_stand_still_while_the_drone_flies_on(
    yaw: float, forward: float, left: float
) -> None:
    """A wall 4 m ahead is nearer by what the drone has flown since the picture."""
    wall = [(4.0, side) for side in np.arange(-2.0, 2.0, 0.1)]
    seen = clearance(*wall, at=pose(3.0, -2.0, yaw))
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    across = np.array([-ahead[1], ahead[0]])
    place = np.array([3.0, -2.0]) + forward * ahead + left * across
    nearer = clearance(*[(4.0 - forward, side) for _, side in wall])
    now = pose(float(place[0]), float(place[1]), yaw)
    assert seen.speed(FAR, now) == pytest.approx(nearer.speed(FAR, None), abs=1e-6)


def test_the_targets_own_body_does_not_block_the_way_to_it() -> None:
    """Nor what stands behind it; what stands well before it does."""
    target = RelativeTarget(0.0, 2.0)
    assert clearance((1.8, 0.1), (2.3, 0.0), (4.0, 0.0)).speed(target, None) == math.inf
    assert clearance((0.9, 0.1)).speed(target, None) < 0.3


def test_a_picture_without_depth_leaves_what_is_known() -> None:
    """One with depth that shows nothing frees the way."""
    seen = clearance((0.7, 0.0))
    seen.see(None, None, INTERVAL)
    assert seen.speed(FAR, None) == 0.0
    seen.see(np.zeros((0, 2)), None, INTERVAL)
    assert seen.speed(FAR, None) == math.inf


def seen_from(at: Odometry, point: tuple[float, float, float]) -> Detections:
    """A frame whose depth shows one thing, at this place of the level body frame."""
    tilt = rotation_from_rpy(at.roll, at.pitch, 0.0)
    u, v, depth = CAMERA.project(tilt.T @ np.array(point))
    cells = np.zeros((18, 32), np.uint16)
    assert 0 <= u < CAMERA.width
    assert 0 <= v < CAMERA.height
    cells[int(v / 20), int(u / 20)] = round(1000 * depth)
    return Detections(Header(0, 0, "cam"), (), 640, 360, CAMERA, at, cells)


@given(
    forward=st.floats(2.0, 8.0),
    bearing=st.floats(-0.4, 0.4),
    roll=st.floats(-0.15, 0.15),
    pitch=st.floats(-0.1, 0.1),
)
def test_what_is_at_the_drones_height_is_found_from_any_attitude(
    forward: float, bearing: float, roll: float, pitch: float
) -> None:
    """Within the size of a cell."""
    left = forward * math.tan(bearing)
    found = surfaces(seen_from(pose(roll=roll, pitch=pitch), (forward, left, 0.0)))
    assert found is not None
    assert found.shape == (1, 2)
    np.testing.assert_allclose(found[0], (forward, left), atol=0.05 * forward)


@pytest.mark.parametrize("up", [-1.35, -0.8, 0.8])
def test_what_the_drone_flies_over_or_under_is_not_in_its_way(up: float) -> None:
    """The ground, a bench, a branch."""
    found = surfaces(seen_from(pose(), (4.0, 0.0, up)))
    assert found is not None
    assert found.size == 0


def test_without_depth_or_calibration_nothing_is_known() -> None:
    """Which is not the same as a free way."""
    whole = seen_from(pose(), (4.0, 0.0, 0.0))
    bare = Detections(whole.header, (), 640, 360, CAMERA, whole.odometry)
    uncalibrated = Detections(whole.header, (), 640, 360, None, whole.odometry, whole.nearest)
    assert surfaces(bare) is None
    assert surfaces(uncalibrated) is None
