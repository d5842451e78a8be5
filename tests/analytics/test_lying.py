"""A body that lies is told from one that stands by the ground it covers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from aerodaas.analytics.people.lying import lies
from aerodaas.geometry.frames import CameraModel, enu_to_body
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.skeleton import KEYPOINTS, Posture, joints

CAMERA = CameraModel.from_fov(640, 360, math.radians(75), pitch=math.radians(12))
LEGS_ONLY = slice(0, 11)


def seen(up: float, camera: CameraModel | None = CAMERA) -> Detections:
    """A frame from `up` metres above the ground."""
    pose = Odometry(np.array([0.0, 0.0, up]), np.zeros(3), 0.0)
    return Detections(Header(0, 0, "drone/cam"), (), 640, 360, camera, pose)


def keypoints(posture: Posture, ahead: float, turn: float, up: float) -> np.ndarray:
    """A body's exact keypoints; those beside the picture are not seen."""
    body = joints(1.75, posture)[list(KEYPOINTS)]
    placed = np.array([enu_to_body(point, turn) for point in body]) + np.array([ahead, 0.0, -up])
    pixels = np.array([CAMERA.project(point) for point in placed])
    inside = (np.abs(pixels[:, 0] - 320) < 320) & (np.abs(pixels[:, 1] - 180) < 180)
    return np.column_stack([pixels[:, :2], 0.9 * (inside & (pixels[:, 2] > 0))])


@example(turn=3.0, ahead=8.0, up=1.3125, forward=False)
@given(
    turn=st.floats(-math.pi, math.pi),
    ahead=st.floats(5.0, 8.0),
    up=st.floats(1.3, 2.0),
    forward=st.booleans(),
)
def test_a_fallen_body_lies_and_a_standing_one_does_not(
    turn: float, ahead: float, up: float, *, forward: bool
) -> None:
    """From whatever side, whatever the arms do."""
    fallen = Posture(fallen=1.0, forward=forward)
    assert lies(keypoints(fallen, ahead, turn, up), seen(up), 0.35)
    for posture in (Posture(), Posture(raised=1.0), Posture(0.3, 0.9)):
        assert not lies(keypoints(posture, ahead, turn, up), seen(up), 0.35)


@pytest.mark.parametrize("fallen", [0.0, 1.0])
def test_hips_and_legs_are_enough(fallen: float) -> None:
    """Head and trunk are hidden by the hips of one who has fallen forward, seen from behind."""
    points = keypoints(Posture(fallen=fallen, forward=True), 2.2, 0.0, 1.5)
    points[LEGS_ONLY, 2] = 0.0
    assert lies(points, seen(1.5), 0.35) is bool(fallen)


def test_it_is_not_told_without_the_ground_or_the_joints() -> None:
    """None is no answer, and takes nothing from the classifier's."""
    points = keypoints(Posture(fallen=1.0), 4.0, 0.5, 1.5)
    assert lies(points, seen(1.5, None), 0.35) is None
    assert lies(points, seen(1.5), 0.95) is None
    assert lies(np.full((17, 3), np.nan), seen(1.5), 0.35) is None
