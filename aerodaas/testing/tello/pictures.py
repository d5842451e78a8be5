"""What the emulated Tello films: the simulated world, or a pattern that tells its own time."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.simulated import SimulatedCamera
from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.config import EnvironmentConfig, RobotConfig, SensorConfig, SimulationConfig
from aerodaas.data import Odometry
from aerodaas.testing.tello.options import VideoOptions

__all__ = ["PictureSource", "picture_source", "read_clock"]

Image: TypeAlias = NDArray[np.uint8]
PictureSource: TypeAlias = Callable[[float, Odometry], Image]
"""The picture at a time in seconds from a pose: height x width x 3, BGR."""

_BITS, _CHECK = 32, 8
_CELL = 16
"""Pixels of one bit's square: a whole macroblock, which the encoder keeps."""
_STAMPS: int = 2**_BITS
_MASK: int = 2**_CHECK - 1
_MIDDLE = 128


@contextlib.contextmanager
def picture_source(video: VideoOptions) -> Iterator[PictureSource]:
    """Open what `video` names."""
    if video.source == "clock":
        yield _Clock(video)
        return
    sensor = SensorConfig(
        id="tello_camera",
        settings={
            "width": video.width,
            "height": video.height,
            "horizontal_fov": video.horizontal_fov,
            "mount": (0.035, 0.0, 0.0),
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


class _Clock:
    """A textured picture that drifts, with the host's milliseconds in squares along its top."""

    def __init__(self, video: VideoOptions) -> None:
        noise = np.random.default_rng(0).integers(
            0, 256, (video.height // 8, video.width // 8, 3), np.uint8
        )
        self._size = (video.width, video.height)
        wide = (2 * video.width, video.height)
        self._wall = np.asarray(cv2.resize(noise, wide, interpolation=cv2.INTER_CUBIC), np.uint8)

    def __call__(self, seconds: float, _: Odometry) -> Image:
        width = self._size[0]
        shift = int(seconds * 60) % width
        image = self._wall[:, shift : shift + width].copy()
        stamp = (host_time_ns() // 1_000_000) % _STAMPS
        word = (stamp << _CHECK) | _checksum(stamp)
        for bit in range(_BITS + _CHECK):
            lit = word >> (_BITS + _CHECK - 1 - bit) & 1
            row, column = divmod(bit, width // _CELL)
            y, x = row * _CELL, column * _CELL
            image[y : y + _CELL, x : x + _CELL] = 255 * lit
        return image


def read_clock(image: Image) -> float | None:
    """Age in milliseconds of a picture of the clock pattern; None if it cannot be read."""
    columns = image.shape[1] // _CELL
    word = 0
    for bit in range(_BITS + _CHECK):
        row, column = divmod(bit, columns)
        y, x = row * _CELL + _CELL // 4, column * _CELL + _CELL // 4
        lit = image[y : y + _CELL // 2, x : x + _CELL // 2].mean() > _MIDDLE
        word = word << 1 | int(lit)
    stamp, check = word >> _CHECK, word & (_MASK)
    if check != _checksum(stamp):
        return None
    return float((host_time_ns() // 1_000_000 - stamp) % _STAMPS)


def _checksum(stamp: int) -> int:
    total: int = sum(stamp.to_bytes(_BITS // 8, "big")) * 37
    return total & (_MASK)
