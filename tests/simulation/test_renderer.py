"""What the renderer draws lies where the camera model says, from any pose."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from panda3d.core import TransformState

from aerodaas.config.model import SimulationConfig
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.renderer import Renderer
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World

POST = 0.3
"""Metres: height of the short posts used as markers."""

CAMERAS = {
    "plain": CameraModel.from_fov(320, 180, math.radians(80)),
    "mounted": CameraModel.from_fov(
        320, 180, math.radians(80), mount=(0.4, -0.3, 0.2), pitch=0.35, yaw=0.3
    ),
    "skewed": CameraModel(320, 180, 200.0, 150.0, 130.0, 110.0),
}


def world(*entities: dict[str, Any], seed: int = 1) -> World:
    """Make a world of these entities on a meadow."""
    scenario = Scenario.model_validate({"name": "test", "entities": list(entities)})
    return World(scenario, seed)


def pose(
    x: float, y: float, z: float, *, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0
) -> Odometry:
    """Make a pose at rest."""
    return Odometry(np.array([x, y, z]), np.zeros(3), yaw, roll, pitch)


def pixel(camera: CameraModel, at: Odometry, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixel of an ENU point by the camera model alone."""
    body = rotation_from_rpy(at.roll, at.pitch, at.yaw).T @ (point - at.position)
    u, v, depth = camera.project(body)
    assert depth > 0
    return np.array([u, v])


def difference(one: World, other: World, camera: CameraModel, at: Odometry) -> NDArray[np.float64]:
    """Pixels (n, 2), by their centres, in which two worlds look different."""
    pictures = []
    for shown in (one, other):
        renderer = Renderer(shown, camera)
        pictures.append(renderer.render(0.0, at).astype(int))
        renderer.close()
    rows, columns = np.nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 12)
    return np.stack([columns, rows], axis=1).astype(np.float64) + 0.5


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=list(CAMERAS))
@pytest.mark.parametrize(
    "at",
    [
        pose(0, 0, 1.5),
        pose(0, 0, 1.5, yaw=0.3),
        pose(0, 0, 1.5, yaw=-0.25),
        pose(0, 0, 1.5, pitch=0.2),
        pose(0, 0, 1.5, pitch=-0.15),
        pose(0, 0, 1.5, roll=0.35),
        pose(0, 0, 1.5, roll=-0.35),
        pose(-1, 0.5, 2.5, roll=0.2, pitch=0.25, yaw=0.2),
    ],
    ids=lambda at: f"rpy={at.roll},{at.pitch},{at.yaw}",
)
def test_a_point_is_drawn_where_the_camera_model_projects_it(
    camera: CameraModel, at: Odometry
) -> None:
    """Markers left, right, near and far appear within 1.5 pixels of their projection."""
    seen = 0
    for x, y in ((6.0, 1.5), (6.5, -1.5), (4.5, 0.6)):
        marker = {
            "kind": "fence",
            "id": "marker",
            "points": [(x, y), (x + 0.02, y)],
            "height": POST,
        }
        wanted = pixel(camera, at, np.array([x + 0.01, y, POST / 2]))
        margin = 12
        if not (
            margin < wanted[0] < camera.width - margin
            and margin < wanted[1] < camera.height - margin
        ):
            continue
        marked = difference(world(marker), world(), camera, at)
        assert len(marked) > 10
        assert marked.mean(axis=0) == pytest.approx(wanted, abs=1.5)
        seen += 1
    assert seen >= 1


@pytest.mark.parametrize(("distance", "yaw"), [(3.0, 180), (4.0, 60), (6.0, 0)])
def test_a_vest_is_drawn_in_its_labelled_box(distance: float, yaw: float) -> None:
    """The vest's pixels fill the projection of its box: labels for training are exact."""
    camera = CameraModel.from_fov(640, 360, math.radians(70))
    people = world(
        {"kind": "person", "id": "vip", "vest": "pink", "at": (distance, 0.3), "yaw": yaw}
    )
    renderer = Renderer(people, camera)
    at = pose(0, 0, 1.4)
    picture = renderer.render(0.0, at).astype(int)
    renderer.close()
    blue, green, red = picture[..., 0], picture[..., 1], picture[..., 2]
    rows, columns = np.nonzero((red > 120) & (green < 0.5 * red) & (blue > 1.3 * green))
    box = next(box for box in people.boxes(0.0) if box.label == "vest")
    corners = np.array([pixel(camera, at, corner) for corner in box.corners])
    (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
    assert left - 2 <= columns.min()
    assert columns.max() <= right + 2
    assert top - 2 <= rows.min()
    assert rows.max() <= bottom + 2
    drawn = (columns.max() - columns.min()) * (rows.max() - rows.min())
    # Seen askew, an arm hides a part of it and the box's corners reach further than its cloth.
    assert drawn > 0.45 * (right - left) * (bottom - top)


def test_a_walker_moves_with_time() -> None:
    """A person is drawn where the world says that it is at the picture's time."""
    walk = {"points": [(5.0, 2.0), (5.0, -2.0)], "speed": 1.0, "variation": 0.0}
    walkers = world({"kind": "person", "id": "vip", "vest": "pink", "motion": walk})
    camera, at = CAMERAS["plain"], pose(0, 0, 1.2)
    renderer = Renderer(walkers, camera)
    middles = []
    for time in (0.0, 2.0, 4.0):
        picture = renderer.render(time, at).astype(int)
        _, columns = np.nonzero((picture[..., 2] > 120) & (picture[..., 1] < 0.5 * picture[..., 2]))
        state = walkers.thing("vip").state(time)
        wanted = pixel(camera, at, np.array([state.x, state.y, 1.2]))
        middles.append(columns.mean())
        assert columns.mean() + 0.5 == pytest.approx(wanted[0], abs=3.0)
    renderer.close()
    assert middles == sorted(middles)


def test_the_same_seed_gives_the_same_picture_and_another_seed_another() -> None:
    """Pictures are a pure function of scenario, seed, time and pose, to the last bit."""
    camera, at = CAMERAS["plain"], pose(-6, 5, 1.5)
    pictures = []
    for seed in (1, 1, 1, 1, 2):
        renderer = Renderer(World.load(SimulationConfig(world="field", seed=seed)), camera)
        pictures.append(renderer.render(0.0, at))
        renderer.close()
    *same, other = pictures
    assert all(np.array_equal(picture, same[0]) for picture in same)
    assert not np.array_equal(other, same[0])


def test_a_picture_occupies_no_second_thread() -> None:
    """OpenCV's others would spin beside the renderer, on a core that other actors need."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(4)
    try:
        Renderer(world(), CAMERAS["plain"]).close()
        assert cv2.getNumThreads() == 1
    finally:
        cv2.setNumThreads(before)


def test_sky_above_and_meadow_below() -> None:
    """Channels are BGR and the picture stands upright."""
    renderer = Renderer(world(), CAMERAS["plain"])
    picture = renderer.render(0.0, pose(0, 0, 1.5)).astype(float)
    renderer.close()
    sky, meadow = picture[:20].mean(axis=(0, 1)), picture[-20:].mean(axis=(0, 1))
    assert sky[0] > sky[2]
    assert meadow[1] > meadow[0]
    assert meadow[1] > meadow[2] > meadow[0]


def test_a_long_flight_does_not_fill_the_memory() -> None:
    """panda3d keeps nothing of the poses that a camera has passed through."""
    renderer = Renderer(world(), CameraModel.from_fov(64, 48, 1.0))
    renderer.render(0.0, pose(0, 0, 1.5))
    before = TransformState.get_num_states()
    for step in range(50):
        renderer.render(0.0, pose(0.1 * step, 0, 1.5, yaw=0.02 * step))
    renderer.close()
    assert TransformState.get_num_states() <= before + 5
