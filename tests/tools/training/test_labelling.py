"""Labels are exact: they come from the pixels and from the skeleton that was drawn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.analytics.models import DETECTOR_CLASSES
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World
from tools.training.labelling import Label, LabellingRenderer, box_of, project, visibility

CAMERA = CameraModel.from_fov(640, 360, math.radians(70))
HERE = Odometry(np.array([0.0, 0.0, 1.4]), np.zeros(3), 0.0)
VIP = {"kind": "person", "id": "vip", "vest": "pink", "at": (4.0, 0.3), "yaw": 180.0}


def look(*entities: dict[str, Any]) -> tuple[dict[str, Label], np.ndarray]:
    """Label what a camera at HERE sees, by class name, beside the picture."""
    world = World(Scenario.model_validate({"name": "test", "entities": list(entities)}), 1)
    renderer = LabellingRenderer(world, CAMERA)
    picture = renderer.render(0.0, HERE)
    labels = {DETECTOR_CLASSES[label.kind]: label for label in renderer.labels(0.0, HERE)}
    renderer.close()
    return labels, picture


def test_a_vest_is_labelled_by_its_own_pixels() -> None:
    """The box is that of the pink pixels, to the pixel that shading may cost."""
    labels, picture = look(VIP)
    blue, green, red = picture.astype(int).transpose(2, 0, 1)
    rows, columns = np.nonzero((red > 120) & (green < 0.5 * red) & (blue > 1.3 * green))
    drawn = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert labels["vest"].box == pytest.approx(drawn, abs=8)
    assert labels["vest"].keypoints is None


def test_a_persons_keypoints_lie_where_the_skeleton_is_drawn() -> None:
    """All 17 are in the person's box; facing the camera, the face and the shoulders are seen."""
    labels, _ = look(VIP)
    person = labels["person"]
    points = person.keypoints
    assert points is not None
    left, top, right, bottom = person.box
    assert ((points[:, 0] > left) & (points[:, 0] < right)).all()
    assert ((points[:, 1] > top) & (points[:, 1] < bottom)).all()
    assert (points[[0, 5, 6], 2] == 2).all()
    # The person faces us: its left shoulder is on our right.
    assert points[5, 0] > points[6, 0]


def test_what_is_hidden_has_no_label_and_what_is_cut_has_a_cut_one() -> None:
    """A house hides the person behind it; a car that is half outside ends at the edge."""
    house = {"kind": "building", "id": "house", "at": (3.0, 0.0), "size": (0.5, 3.0, 3.0)}
    car = {"kind": "car", "id": "car", "at": (7.0, 6.0), "yaw": 90.0}
    labels, _ = look(VIP, {**house, "yaw": 0.0, "roof": "flat"}, car)
    assert set(labels) == {"car"}
    assert labels["car"].box[0] == 0
    assert labels["car"].box[2] > 20


def test_every_kind_is_labelled_and_nothing_else() -> None:
    """Trees, houses and roads have none."""
    labels, _ = look(
        VIP,
        {"kind": "car", "id": "car", "at": (12.0, -4.0)},
        {"kind": "tower", "id": "tower", "at": (40.0, 12.0), "height": 20.0},
        {"kind": "tree", "id": "tree", "at": (14.0, 4.0)},
        {"kind": "road", "id": "road", "points": [(5.0, -9.0), (5.0, 9.0)]},
    )
    assert set(labels) == set(DETECTOR_CLASSES)


ANGLE = st.floats(-3.0, 3.0)
PLACE = st.floats(-30.0, 30.0)


@given(
    st.tuples(PLACE, PLACE, PLACE), st.tuples(ANGLE, ANGLE, ANGLE), st.tuples(PLACE, PLACE, PLACE)
)
def test_points_are_projected_as_the_camera_model_does(
    eye: tuple[float, float, float],
    angles: tuple[float, float, float],
    point: tuple[float, float, float],
) -> None:
    """Any camera, any pose; behind the camera there is no pixel."""
    camera = CameraModel(320, 200, 210.0, 190.0, 150.0, 110.0, (0.1, -0.2, 0.3), 0.4, -0.3)
    pose = Odometry(np.array(eye), np.zeros(3), angles[2], angles[0], angles[1])
    body = rotation_from_rpy(*angles).T @ (np.array(point) - pose.position)
    u, v, depth = camera.project(body)
    (pixel,) = project(camera, pose, np.array([point]))
    if depth > 1e-6:
        assert pixel == pytest.approx([u, v], rel=1e-6, abs=1e-6)
    elif depth < -1e-6:
        assert np.isnan(pixel).all()


@given(
    st.integers(0, 50),
    st.integers(0, 30),
    st.integers(1, 50),
    st.integers(1, 30),
    st.integers(1, 9),
)
def test_a_box_holds_exactly_the_pixels_shown(
    left: int, top: int, width: int, height: int, least: int
) -> None:
    """Left and top are inclusive, right and bottom are not; narrower than `least` is none."""
    shown = np.zeros((60, 100), dtype=bool)
    shown[top : top + height, left : left + width] = True
    box = box_of(shown, least)
    if min(width, height) < least:
        assert box is None
    else:
        assert box is not None
        assert box.tolist() == [left, top, left + width, top + height]


@given(st.lists(st.tuples(st.floats(-50, 150), st.floats(-50, 110)), min_size=1, max_size=17))
def test_a_keypoint_is_outside_hidden_or_seen(places: list[tuple[float, float]]) -> None:
    """Whatever the place; those outside have no coordinates either."""
    shown = np.zeros((60, 100), dtype=bool)
    shown[:, 40:] = True
    for (u, v), row in zip(places, visibility(np.array(places), shown), strict=True):
        inside = 0 <= u < 100 and 0 <= v < 60
        assert row[2] == (1 + (u >= 40) if inside else 0)
        assert row[:2].tolist() == ([u, v] if inside else [0.0, 0.0])
