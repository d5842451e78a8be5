"""The simulated camera behaves as the Camera protocol says."""

from __future__ import annotations

import math
import subprocess
import sys

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from aerodaas.cameras.base import Camera, ZoomingCamera
from aerodaas.cameras.simulated import SimulatedCamera
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig, SimulationConfig
from aerodaas.errors import ConfigError, SourceError
from aerodaas.messages.odometry import Odometry

POSE = Odometry(np.array([0.0, 0.0, 1.5]), np.zeros(3), 0.8)


def make(world: str = "empty", **settings: object) -> SimulatedCamera:
    """Make a camera with these settings."""
    environment = EnvironmentConfig(
        robots=[RobotConfig(id="drone")], simulation=SimulationConfig(world=world)
    )
    return SimulatedCamera(SensorConfig(id="front", settings=settings), environment)


def test_a_picture_has_the_size_and_stamp_asked_for() -> None:
    """Pictures are height x width x 3 of uint8 at the stamp of the capture."""
    camera = make(width=128, height=72, horizontal_fov=60, pitch=20, mount=(0.2, 0.0, -0.1))
    assert isinstance(camera, Camera)
    camera.open()
    picture = camera.capture(1_500_000_000, POSE)
    assert picture is not None
    assert picture.image.shape == (72, 128, 3)
    assert picture.image.dtype == np.uint8
    assert picture.stamp == 1_500_000_000
    assert picture.image.std() > 5
    camera.close()
    assert camera.model.mount == (0.2, 0.0, -0.1)
    assert camera.model.pitch == pytest.approx(math.radians(20))
    assert camera.model.fx == pytest.approx(64 / math.tan(math.radians(30)))


def test_pictures_stay_as_they_were_taken() -> None:
    """A later capture does not write into an earlier picture."""
    camera = make("field", width=64, height=48)
    camera.open()
    first = camera.capture(0, POSE)
    assert first is not None
    copy = first.image.copy()
    camera.capture(0, Odometry(np.array([5.0, 5.0, 9.0]), np.zeros(3), -2.0))
    assert np.array_equal(first.image, copy)
    camera.close()


def test_without_a_pose_there_is_no_picture() -> None:
    """A camera whose vehicle is unknown gives nothing."""
    camera = make(width=64, height=48)
    camera.open()
    assert camera.capture(0, None) is None
    camera.close()


def test_a_camera_must_be_open_and_may_be_opened_again() -> None:
    """Capturing before `open` or after `close` says so; opening again works."""
    camera = make(width=64, height=48)
    with pytest.raises(SourceError, match="front is not open"):
        camera.capture(0, POSE)
    for _ in range(2):
        camera.open()
        assert camera.capture(0, POSE) is not None
        camera.close()
    with pytest.raises(SourceError):
        camera.capture(0, POSE)


def test_broken_settings_and_worlds_are_told_at_once() -> None:
    """The constructor refuses what `open` could not work with."""
    with pytest.raises(ConfigError, match=r"front.*fov.*horizontal_fov"):
        make(fov=60)
    with pytest.raises(ConfigError, match="atlantis"):
        make("atlantis")


def test_a_camera_that_is_not_opened_does_not_load_the_renderer() -> None:
    """Importing and making a camera is cheap: panda3d is loaded by `open`."""
    code = (
        "import sys, aerodaas.cameras.simulated, aerodaas.drivers.simulated;"
        "sys.exit('panda3d' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_lens_that_zooms_sees_less_and_says_so() -> None:
    """The middle of the wide picture, as large; its model has the focal length; depth follows."""
    camera = make("field", width=128, height=96, zoom=3.0, depth_range=20.0)
    assert isinstance(camera, ZoomingCamera)
    camera.open()
    wide = camera.capture(0, POSE)
    focal = camera.model.fx
    camera.follow_zoom(50.0)
    near = camera.capture(0, POSE)
    assert (camera.model.fx, camera.model.fy) == pytest.approx((2 * focal, 2 * focal))
    camera.follow_zoom(None)
    again = camera.capture(0, POSE)
    camera.close()
    assert wide is not None
    assert near is not None
    assert again is not None
    assert np.array_equal(wide.image, again.image)

    def apart(picture: NDArray[np.uint8]) -> float:
        middle = cv2.resize(picture[24:72, 32:96], (128, 96)).astype(np.float64)
        return float(np.abs(middle - near.image).mean())

    assert apart(wide.image) < 0.5 * float(np.abs(wide.image.astype(float) - near.image).mean())
    assert wide.depth is not None
    assert near.depth is not None
    assert float(near.depth[90, 64]) == pytest.approx(float(wide.depth[69, 64]), rel=0.05)


def test_a_lens_without_a_zoom_stays() -> None:
    """Whatever the vehicle says."""
    camera = make(width=64, height=48)
    camera.open()
    focal = camera.model.fx
    camera.follow_zoom(100.0)
    camera.capture(0, POSE)
    camera.close()
    assert camera.model.fx == focal
