"""Images of the emulated Tello: the simulated world, or a pattern with its own time."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.simulated import SimulatedCamera
from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig, SimulationConfig
from aerodaas.messages.odometry import Odometry
from tools.tello_vehicle.options import VideoOptions
from tools.tello_vehicle.stamp import write_stamp

__all__ = ["PictureSource", "picture_source"]

Image: TypeAlias = NDArray[np.uint8]
PictureSource: TypeAlias = Callable[[float, Odometry], Image]
"""The image at a time in seconds from a pose: height x width x 3, BGR."""


@contextlib.contextmanager
def picture_source(video: VideoOptions) -> Iterator[PictureSource]:
    """Open what `video` names."""
    if video.source == "clock":
        yield _clock(video)
        return
    sensor = SensorConfig(
        id="tello_camera",
        settings={
            "width": video.width,
            "height": video.height,
            "horizontal_fov": video.horizontal_fov,
            "mount": (0.035, 0.0, 0.0),
            "pitch": video.pitch,
        },
    )
    world = SimulationConfig(world=video.world, seed=video.seed)
    camera = SimulatedCamera(
        sensor, EnvironmentConfig(robots=[RobotConfig(id="tello")], simulation=world)
    )
    camera.open()

    def film(seconds: float, pose: Odometry) -> Image:
        picture = camera.capture(int(seconds * NANOSECONDS), pose)
        assert picture is not None  # noqa: S101 - a pose was given
        return picture.image

    try:
        yield film
    finally:
        camera.close()


def _clock(video: VideoOptions) -> PictureSource:
    """A textured image that drifts, with the host's milliseconds in its top rows."""
    noise = np.random.default_rng(0).integers(
        0, 256, (video.height // 8, video.width // 8, 3), np.uint8
    )
    wide = (2 * video.width, video.height)
    wall = np.asarray(cv2.resize(noise, wide, interpolation=cv2.INTER_CUBIC), np.uint8)

    def film(seconds: float, _: Odometry) -> Image:
        shift = int(seconds * 60) % video.width
        image: Image = wall[:, shift : shift + video.width].copy()
        write_stamp(image, host_time_ns() // 1_000_000)
        return image

    return film
