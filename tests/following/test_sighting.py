"""Distance and bearing from a box are right, and never too far where the box is cut."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from aerodaas.following.target import TargetSize, sight
from aerodaas.geometry.frames import Box, CameraModel, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry

PERSON = TargetSize(1.7, 0.5)
WIDE, TALL = 1280, 720
_LEANS = 0.2
"""Pitch of the camera in radians from which on a drone's tilt makes people lean too much."""


def camera(pitch: float = 0.0) -> CameraModel:
    """A Tello-like camera at the body's centre."""
    return CameraModel.from_fov(WIDE, TALL, math.radians(82.6), pitch=pitch)


def project(
    model: CameraModel, distance: float, bearing: float, *, eye: float = 1.5, tilt: float = 0.0
) -> Box | None:
    """Box of an upright plate PERSON's size that faces the drone; None if it is behind."""
    towards = np.array([math.cos(bearing), math.sin(bearing), 0.0])
    across = np.array([-towards[1], towards[0], 0.0])
    body_from_level = rotation_from_rpy(0.0, tilt, 0.0).T
    corners = [
        body_from_level @ (distance * towards + side * across * 0.25 + np.array([0, 0, up - eye]))
        for side in (-1, 1)
        for up in (0.0, 1.7)
    ]
    pixels = [model.project(corner) for corner in corners]
    if any(depth <= 0.05 for _, _, depth in pixels):
        return None
    us, vs = [u for u, _, _ in pixels], [v for _, v, _ in pixels]
    return min(us), min(vs), max(us), max(vs)


def found(box: Box, model: CameraModel | None, tilt: float = 0.0) -> Detections:
    """The frame in which `box` was found."""
    odometry = Odometry(np.zeros(3), np.zeros(3), 0.0, pitch=tilt)
    item = Detection(box, "person", 0.9)
    return Detections(Header(0, 0, "cam"), (item,), WIDE, TALL, model, odometry)


@given(
    distance=st.floats(4, 20),
    bearing=st.floats(-0.6, 0.6),
    pitch=st.floats(-0.1, 0.2),
    tilt=st.floats(-0.1, 0.1),
)
@settings(max_examples=100)
@example(distance=4.0, bearing=0.1875, pitch=0.1875, tilt=0.09375)
def test_a_whole_object_is_located(
    distance: float, bearing: float, pitch: float, tilt: float
) -> None:
    """Whatever the camera's pitch and the drone's tilt, to 5 % and 2 degrees ahead.

    Towards the picture's sides a tilted camera sees an upright object lean. Its box is then too
    wide, and the object may seem nearer than it is, never farther.
    """
    model = camera(pitch)
    box = project(model, distance, bearing, tilt=tilt)
    assert box is not None
    assume(box[0] > 40 and box[1] > 22 and box[2] < WIDE - 40 and box[3] < TALL - 22)
    detections = found(box, model, tilt)
    seen = sight(detections[0], detections, PERSON)
    assert seen is not None
    assert seen.bearing == pytest.approx(bearing, abs=0.035)
    assert not seen.bound
    ahead = 0.2
    if abs(bearing) < ahead:
        assert seen.distance == pytest.approx(distance, rel=0.05)
        leaning = 1.7 * math.sin(abs(bearing)) * math.tan(abs(pitch) + abs(tilt))
        assert seen.width is not None
        assert 0.47 < seen.width < 0.54 + leaning
    assert 0.6 * distance < seen.distance < 1.05 * distance


@given(distance=st.floats(0.6, 6), bearing=st.floats(-0.7, 0.7), eye=st.floats(0.5, 3))
@settings(max_examples=200)
def test_a_cut_object_never_seems_farther_than_it_is(
    distance: float, bearing: float, eye: float
) -> None:
    """Or the sighting says that its distance is no more than an upper bound."""
    model = camera()
    whole = project(model, distance, bearing, eye=eye)
    assume(whole is not None)
    assert whole is not None
    box = (max(0, whole[0]), max(0, whole[1]), min(WIDE, whole[2]), min(TALL, whole[3]))
    assume(box[2] - box[0] > 5 and box[3] - box[1] > 5)
    detections = found(box, model)
    seen = sight(detections[0], detections, PERSON)
    assume(seen is not None)
    assert seen is not None
    if not seen.bound:
        assert seen.distance < 1.35 * distance
    assert seen.distance > 0.6 * distance


def test_feet_out_of_the_picture_do_not_draw_the_drone_in() -> None:
    """At 2 m a level camera loses the feet: by its height alone the person would seem at 2.9 m."""
    model = camera()
    whole = project(model, 2.0, 0.0)
    assert whole is not None
    assert whole[3] > TALL
    detections = found((*whole[:3], TALL - 12.0), model)
    seen = sight(detections[0], detections, PERSON)
    assert seen is not None
    assert seen.distance == pytest.approx(2.0, rel=0.05)
    assert seen.width is None


def test_half_hidden_by_a_wall_it_seems_no_farther() -> None:
    """The lower half of the box is missing, nowhere near the picture's edge."""
    model = camera()
    whole = project(model, 5.0, 0.0)
    assert whole is not None
    half = (*whole[:3], (whole[1] + whole[3]) / 2)
    detections = found(half, model)
    seen = sight(detections[0], detections, PERSON)
    assert seen is not None
    assert seen.distance == pytest.approx(5.0, rel=0.05)


def test_left_of_the_picture_is_left_of_the_drone() -> None:
    """FLU: left is positive."""
    left = found((200, 200, 260, 400), camera())
    right = found((1020, 200, 1080, 400), camera())
    seen = [sight(item[0], item, PERSON) for item in (left, right)]
    assert seen[0] is not None
    assert seen[1] is not None
    assert seen[0].bearing > 0.3
    assert seen[1].bearing == pytest.approx(-seen[0].bearing)
    assert seen[0].offset[1] > 0


def test_a_picture_resized_on_the_way_gives_the_same() -> None:
    """The calibration's size counts, not that of the picture in which the box was found."""
    box = (500.0, 100.0, 560.0, 300.0)
    full = found(box, camera())
    half = replace(
        full,
        width=WIDE // 2,
        height=TALL // 2,
        items=(replace(full[0], box=(250.0, 50.0, 280.0, 150.0)),),
    )
    assert sight(half[0], half, PERSON) == sight(full[0], full, PERSON)


@pytest.mark.parametrize(
    "box",
    [(math.nan, 0, 10, 10), (0, 0, math.inf, 10), (5, 5, 5, 5), (10, 10, 0, 0), (3, 9, 30, 9)],
)
def test_a_box_that_says_nothing_gives_no_sighting(box: Box) -> None:
    """Nor does a camera without calibration."""
    detections = found(box, camera())
    assert sight(detections[0], detections, PERSON) is None
    uncalibrated = found((500, 100, 560, 300), None)
    assert sight(uncalibrated[0], uncalibrated, PERSON) is None


@given(
    distance=st.floats(2.6, 12),
    thickness=st.floats(0.15, 0.5),
    eye=st.floats(0.8, 3.0),
    pitch=st.floats(0.0, 0.4),
)
@settings(max_examples=100)
def test_who_lies_on_the_ground_is_not_thought_far_away(
    distance: float, thickness: float, eye: float, pitch: float
) -> None:
    """Seen from the side, lying, somebody's box is a fraction of the height assumed."""
    model = camera(pitch)
    corners = [
        np.array([distance, side, up - eye]) for side in (-0.85, 0.85) for up in (0, thickness)
    ]
    pixels = [model.project(corner) for corner in corners]
    us, vs = [u for u, _, _ in pixels], [v for _, v, _ in pixels]
    assume(min(us) > 40 and max(us) < WIDE - 40 and min(vs) > 22 and max(vs) < TALL - 22)
    detections = found((min(us), min(vs), max(us), max(vs)), model)
    assert detections.odometry is not None
    aloft = replace(detections.odometry, position=np.array([5.0, -3.0, eye]))
    seen = sight(detections[0], replace(detections, odometry=aloft), PERSON)
    assert seen is not None
    assert seen.distance <= distance * 1.001


def test_who_seems_far_but_lies_near_is_not_approached() -> None:
    """A fallen person's vest, 35 of 360 pixels high, low in the picture of a level flight."""
    model = CameraModel.from_fov(640, 360, math.radians(82.6), pitch=math.radians(12))
    items = (Detection((306, 196, 343, 231), "vest", 0.9),)
    odometry = Odometry(np.array([29.8, 0.8, 1.47]), np.zeros(3), 0.0)
    detections = Detections(Header(0, 0, "cam"), items, 640, 360, model, odometry)
    seen = sight(detections[0], detections, TargetSize(0.60, 0.43))
    assert seen is not None
    assert seen.bound
    assert 3.0 < seen.distance < 4.5


CAR = TargetSize(1.5, 1.8, widest=4.2)


@given(
    distance=st.floats(5, 20),
    base=st.one_of(st.just(0.0), st.floats(1.5, 4.0)),
    tilt=st.floats(-0.1, 0.1),
    error=st.floats(-0.01, 0.01),
)
@settings(max_examples=100)
def test_what_stands_is_told_from_what_hangs_in_the_air(
    distance: float, base: float, tilt: float, error: float
) -> None:
    """By a car's lower edge, though the drone knows its pitch to half a degree only."""
    model = camera(0.2)
    turn = rotation_from_rpy(0.0, tilt, 0.0)
    eye = 2.5
    corners = [(distance, side, up - eye) for side in (-0.9, 0.9) for up in (base, base + 1.5)]
    pixels = np.array([model.project(turn.T @ np.array(corner)) for corner in corners])
    left, top = pixels[:, :2].min(axis=0).tolist()
    right, bottom = pixels[:, :2].max(axis=0).tolist()
    assume(top > 0 and bottom < TALL)
    pose = Odometry(np.array([0.0, 0.0, eye]), np.zeros(3), 0.0, pitch=tilt + error)
    item = Detection((left, top, right, bottom), "car", 0.9)
    detections = Detections(Header(0, 0, "cam"), (item,), WIDE, TALL, model, pose)
    seen = sight(item, detections, CAR)
    assert seen is not None
    assert seen.afloat is (base > 0.0)


def test_the_length_of_a_car_may_be_its_width() -> None:
    """From its side it is wider than any car from behind, but not than it is long."""
    assert CAR.with_width(4.1).width == pytest.approx(4.1)
    assert CAR.with_width(9.0).width == pytest.approx(4.2)
    assert PERSON.with_width(9.0).width == pytest.approx(0.8)


@given(
    distance=st.floats(1.5, 12),
    bearing=st.floats(-0.6, 0.6),
    pitch=st.floats(-0.1, 0.3),
    tilt=st.floats(-0.1, 0.1),
    tall=st.floats(0.8, 1.4),
)
@settings(max_examples=200)
@example(distance=6.0, bearing=0.5, pitch=0.296875, tilt=0.09375, tall=0.8125)
def test_measured_depth_tells_the_distance_of_anybody(
    distance: float, bearing: float, pitch: float, tilt: float, tall: float
) -> None:
    """Also of who is taller or smaller than assumed, or cut by the picture; then it is no bound.

    Seen from high above, towards the picture's side, somebody leans so much that their width says
    less than half of the distance. Their depth counts as the background's then: they seem nearer.
    """
    model = camera(pitch)
    whole = project(model, distance, bearing, tilt=tilt)
    assume(whole is not None)
    assert whole is not None
    box = (max(0, whole[0]), max(0, whole[1]), min(WIDE, whole[2]), min(TALL, whole[3]))
    assume(box[2] - box[0] > 5 and box[3] - box[1] > 5)
    detections = found(box, model, tilt)
    middle = model.ray(*detections[0].centre)
    level = rotation_from_rpy(0.0, tilt, 0.0) @ middle
    away = distance / (math.hypot(level[0], level[1]) * math.cos(_off(level, bearing)))
    depth = away * float(middle @ model.body_from_optical[:, 2])
    measured = replace(detections, items=(replace(detections[0], depth=depth),))
    seen = sight(measured[0], measured, TargetSize(1.7 * tall, 0.5 * tall))
    assert seen is not None
    assert seen.distance < 1.03 * distance
    if pitch <= _LEANS:
        assert seen.distance == pytest.approx(distance, rel=0.03)
        assert not seen.bound


def _off(ray: np.ndarray, bearing: float) -> float:
    return math.atan2(ray[1], ray[0]) - bearing


@pytest.mark.parametrize("depth", [math.nan, math.inf, 0.0, -1.0, 9.0, 1.5])
def test_a_depth_that_cannot_be_is_not_believed(depth: float) -> None:
    """Nor that of a wall behind a person whose size says 4 m, which would draw the drone in.

    Nor of what passes in between, which would drive it back.
    """
    model = camera()
    box = project(model, 4.0, 0.0)
    assert box is not None
    plain = found(box, model)
    measured = replace(plain, items=(replace(plain[0], depth=depth),))
    assert sight(measured[0], measured, PERSON) == sight(plain[0], plain, PERSON)
