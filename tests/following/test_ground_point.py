"""What stands on the ground is found where it stands, with the error that its camera has."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from grounds import ground
from hypothesis import assume, example, given
from hypothesis import strategies as st

from aerodaas.following.ground_point import GroundPoint, ground_point
from aerodaas.geometry.frames import CameraModel, Vector, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.terrain.ground import Ground

WIDE, TALL = 1280, 720
FULL = math.tau / 2

angles = st.floats(-FULL, FULL)
leans = st.floats(-0.3, 0.3)
cameras = st.builds(
    CameraModel,
    width=st.just(WIDE),
    height=st.just(TALL),
    fx=st.floats(400, 2000),
    fy=st.floats(400, 2000),
    cx=st.floats(600, 680),
    cy=st.floats(300, 420),
    mount=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    pitch=st.floats(-0.2, FULL / 2),
    yaw=angles,
    roll=leans,
)
poses = st.builds(
    Odometry,
    position=st.tuples(st.floats(-200, 200), st.floats(-200, 200), st.floats(1, 100)).map(np.array),
    velocity=st.just(np.zeros(3)),
    yaw=angles,
    roll=leans,
    pitch=leans,
    position_sigma=st.floats(0, 3),
)


def standing(
    place: Vector, camera: CameraModel, pose: Odometry
) -> tuple[Detection, Detections] | None:
    """A box whose foot is at a place; None where the camera does not see it."""
    turned = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
    u, v, depth = camera.project(turned.T @ (place - pose.position))
    if not (depth > 0.1 and 0 <= u <= WIDE and 0 <= v <= 0.96 * TALL):
        return None
    one = Detection((u - 9, v - 40, u + 9, v), "person", 0.9)
    return one, Detections(Header(0, 0, "cam"), (one,), WIDE, TALL, camera, pose)


def found(
    place: Vector, camera: CameraModel, pose: Odometry, terrain: Ground | None = None
) -> GroundPoint | None:
    """Where it is found again; none as well where it is not seen."""
    seen = standing(place, camera, pose)
    return None if seen is None else ground_point(*seen, terrain)


@given(
    cameras,
    poses,
    st.floats(0, WIDE),
    st.floats(0, 0.96 * TALL),
    st.sampled_from([0.5, 1.0, 2.0]),
)
def test_what_is_found_is_seen_in_its_pixel(
    camera: CameraModel, pose: Odometry, u: float, v: float, scale: float
) -> None:
    """Whatever calibration, mount, gimbal, attitude, and size of the analysed picture.

    On the plane, below the horizon and not far away; and nothing is told of any other pixel.
    """
    box = (scale * (u - 9), scale * (v - 40), scale * (u + 9), scale * v)
    one = Detection(box, "person", 0.9)
    size = round(scale * WIDE), round(scale * TALL)
    point = ground_point(one, Detections(Header(0, 0, "cam"), (one,), *size, camera, pose))
    turned = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
    lens = pose.position + turned @ np.array(camera.mount)
    if point is None:
        down = -(turned @ camera.ray(u, v))[2]
        dip = math.asin(max(-1.0, min(1.0, down)))
        near = lens[2] > 0 and dip > 0 and lens[2] / math.tan(dip) < 499.9
        assert dip < math.radians(5.001) or not near
        return
    assert point.up == 0.0
    way = np.array([point.east, point.north, 0.0]) - lens
    assert math.hypot(*way[:2]) <= 500.0
    assert math.atan2(-way[2], math.hypot(*way[:2])) >= math.radians(4.999)
    again = camera.project(turned.T @ (way + lens - pose.position))
    assert again[:2] == pytest.approx((u, v), abs=1e-4)
    assert point.major >= point.minor >= pose.position_sigma * 0.999
    assert -math.pi / 2 <= point.angle <= math.pi / 2


LEVEL = CameraModel.from_fov(WIDE, TALL, math.radians(80))
"""It looks ahead."""
DOWN = CameraModel.from_fov(WIDE, TALL, math.radians(80), pitch=math.pi / 2)
AHEAD = replace(LEVEL, pitch=0.6)
"""It looks down ahead."""
EAST = Odometry(np.array([0.0, 0.0, 20.0]), np.zeros(3), 0.0)
"""It hovers 20 m up and looks east."""


@given(st.floats(0.001, 4.99), leans)
def test_nothing_is_told_near_the_horizon(below: float, pitch: float) -> None:
    """Neither below it nor above, however the drone leans."""
    pose = replace(EAST, pitch=pitch)
    far = 20 / math.tan(math.radians(below))
    for place in (np.array([far, 0.0, 0.0]), np.array([far, 0.0, 20.0 + far * 0.01])):
        assert found(place, LEVEL, pose) is None


def test_nothing_is_told_far_away_or_without_what_it_needs() -> None:
    """Beyond 500 m, and without calibration, pose, or foot in the picture."""
    high = replace(EAST, position=np.array([0.0, 0.0, 120.0]))
    assert found(np.array([499.0, 0.0, 0.0]), LEVEL, high) is not None
    assert found(np.array([501.0, 0.0, 0.0]), LEVEL, high) is None
    seen = standing(np.array([50.0, 0.0, 0.0]), LEVEL, EAST)
    assert seen is not None
    one, all_found = seen
    assert ground_point(one, all_found) is not None
    assert ground_point(one, replace(all_found, camera=None)) is None
    assert ground_point(one, replace(all_found, odometry=None)) is None
    for unknown in (
        replace(EAST, yaw=math.nan),
        replace(EAST, position=np.array([0.0, 0.0, math.nan])),
    ):
        assert ground_point(one, replace(all_found, odometry=unknown)) is None
    left, top, right, _ = one.box
    assert ground_point(replace(one, box=(left, top, right, TALL * 0.98)), all_found) is None
    assert ground_point(replace(one, box=(left, top, math.nan, 600.0)), all_found) is None


def test_below_the_lens_it_is_sharpest() -> None:
    """Straight down, an ellipse is a circle of height times angle; ahead it is drawn out."""
    below = found(np.array([0.0, 0.0, 0.0]), DOWN, EAST)
    assert below is not None
    assert below.major == pytest.approx(20 * math.hypot(math.radians(1.5), 2 / DOWN.fx), rel=0.01)
    assert below.minor == pytest.approx(below.major, rel=0.01)
    ahead = found(np.array([0.0, 60.0, 0.0]), LEVEL, replace(EAST, yaw=math.pi / 2))
    assert ahead is not None
    assert abs(ahead.angle) == pytest.approx(math.pi / 2)
    assert ahead.major > 3 * ahead.minor


@pytest.mark.slow
@given(st.floats(15, 60), st.floats(-15, 15), angles, st.floats(0.1, 2))
@example(40.0, 0.0, 1.0, 1.0)
def test_its_error_is_that_of_many_wrong_cameras(
    ahead: float, aside: float, yaw: float, sigma: float
) -> None:
    """The ellipse is that of places found by poses and pixels which are off by as much."""
    pose = replace(EAST, yaw=yaw, position_sigma=sigma)
    way = rotation_from_rpy(0, 0, yaw) @ np.array([ahead, aside, 0.0])
    seen = standing(pose.position * [1, 1, 0] + way, AHEAD, pose)
    assert seen is not None
    point = ground_point(*seen)
    assert point is not None
    left, _, right, bottom = seen[0].box
    rng = np.random.default_rng(1)
    places = []
    for _ in range(4000):
        wrong = rotation_from_rpy(*rng.normal(0, math.radians(1.5) / 4, 3))
        shifted = rng.normal(0, 2 / 4, 2)
        ray = AHEAD.ray((left + right) / 2 + shifted[0], bottom + shifted[1])
        turned = wrong @ rotation_from_rpy(0, 0, yaw) @ ray
        lens = pose.position + rng.normal(0, sigma / 4, 3)
        places.append(lens[:2] - turned[:2] * lens[2] / turned[2])
    # A quarter of each error: to the first order the spread is a quarter, too.
    spread = 16 * np.cov(np.array(places).T)
    axis = np.array([math.cos(point.angle), math.sin(point.angle)])
    across = np.array([-axis[1], axis[0]])
    assert math.sqrt(axis @ spread @ axis) == pytest.approx(point.major, rel=0.1)
    assert math.sqrt(across @ spread @ across) == pytest.approx(point.minor, rel=0.1)


HILL = ground(lambda east, _: np.clip(0.2 * east, 0, 40), reach=400.0)
"""It climbs by a fifth towards the east, and west of home it is level."""
HOLE = ground(lambda east, _: np.where(east > 20, np.nan, 0.0), reach=400.0)
"""It is not known east of 20 m."""


@given(st.floats(5, 150), st.floats(-30, 30), st.floats(10, 60))
def test_on_a_slope_it_stands_where_the_ray_meets_it(
    east: float, north: float, above: float
) -> None:
    """Nearer than on the plane, at the height of the slope."""
    pose = replace(EAST, position=np.array([0.0, 0.0, above + 0.2 * east]))
    place = np.array([east, north, 0.2 * east])
    point = found(place, AHEAD, pose, HILL)
    assume(point is not None)
    assert point is not None
    assert (point.east, point.north) == pytest.approx(tuple(place[:2]), abs=0.5)
    assert point.up == pytest.approx(place[2], abs=0.2)


def test_ground_that_is_not_known_is_not_met() -> None:
    """Where the terrain has a hole; below the ground nothing is seen."""
    assert found(np.array([16.0, 0.0, 0.0]), AHEAD, EAST, HOLE) is not None
    assert found(np.array([60.0, 0.0, 0.0]), AHEAD, EAST, HOLE) is None
    assert found(np.array([60.0, 0.0, 0.0]), AHEAD, EAST) is not None
    sunken = replace(EAST, position=np.array([100.0, 0.0, 5.0]))
    assert found(np.array([110.0, 0.0, 0.0]), AHEAD, sunken, HILL) is None
    straight = found(np.array([0.0, 0.0, 0.0]), DOWN, EAST, HILL)
    assert straight is not None
    assert straight.up == pytest.approx(0.0, abs=0.01)
