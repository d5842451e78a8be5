"""The depth that a simulated camera measures lies on the surfaces that its picture shows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.renderer import renderer_for
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World

CAMERAS = {
    "plain": CameraModel.from_fov(320, 180, math.radians(80)),
    "mounted": CameraModel.from_fov(
        320, 180, math.radians(80), mount=(0.4, -0.3, 0.2), pitch=0.35, yaw=0.3
    ),
    "skewed": CameraModel(320, 180, 200.0, 150.0, 130.0, 110.0),
}
RANGE = 12.0
WALL = {"kind": "building", "id": "wall", "at": [8.0, 0.0], "yaw": 0.0, "size": [2.0, 30.0, 9.0]}


def world(*entities: dict[str, Any]) -> World:
    """A meadow with these on it."""
    scenario = Scenario.model_validate({"name": "test", "entities": list(entities)})
    return World(scenario, 1)


def pose(z: float, *, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Odometry:
    """At rest above home."""
    return Odometry(np.array([0.0, 0.0, z]), np.zeros(3), yaw, roll, pitch)


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize(
    "at", [pose(1.5), pose(4.0, pitch=0.3, yaw=2.0), pose(2.0, roll=0.2, pitch=-0.1, yaw=-1.0)]
)
def test_the_ground_is_as_far_as_geometry_says(name: str, at: Odometry) -> None:
    """Every pixel of flat ground within the range, from any pose, and nothing of the sky."""
    camera = CAMERAS[name]
    renderer = renderer_for(world(), camera, RANGE)
    renderer.render(0.0, at)
    depth = renderer.depth()
    renderer.close()
    assert depth is not None
    assert depth.dtype == np.uint16
    v, u = np.mgrid[: camera.height, : camera.width] + 0.5
    optical = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1 + 0 * u], -1)
    body = rotation_from_rpy(at.roll, at.pitch, at.yaw)
    falls = (optical @ (body @ camera.body_from_optical).T)[..., 2]
    lens = at.position[2] + (body @ np.array(camera.mount))[2]
    with np.errstate(divide="ignore"):
        expected = np.where(falls < 0, -lens / falls, np.inf)
    near = expected < 0.95 * RANGE
    assert near.any()
    # At the horizon, single pixels are the renderer's rounding.
    assert (depth[expected > 1.05 * RANGE] > 0).sum() <= 3
    error = np.abs(depth[near] / 1000 - expected[near]) / expected[near]
    assert np.median(error) < 0.02
    assert error.max() < 0.05


def test_what_stands_before_the_ground_is_nearer() -> None:
    """A wall 7 m ahead of the drone, in all of the picture's middle; the picture is the same."""
    camera = CAMERAS["plain"]
    plain, measuring = (renderer_for(world(WALL), camera, far) for far in (None, RANGE))
    at = pose(2.0)
    np.testing.assert_array_equal(plain.render(0.0, at), measuring.render(0.0, at))
    assert plain.depth() is None
    depth = measuring.depth()
    assert depth is not None
    middle = depth[60:100, 60:260]
    assert np.abs(middle / 1000 - 7.0).max() < 0.1
    for renderer in (plain, measuring):
        renderer.close()
