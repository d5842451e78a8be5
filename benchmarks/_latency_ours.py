"""The four nodes of the latency benchmark in AeroDaaS: camera, reader, navigation, drone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import _stamps
import numpy as np
from numpy.typing import NDArray

from aerodaas import (
    AeroNavigation,
    Analytics,
    Frame,
    NavigableAnalytics,
    NavigationType,
    Odometry,
    VelocityCommand,
)
from aerodaas.analytics.base import Context
from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.geometry.frames import CameraModel

__all__ = [
    "HEIGHT",
    "RATE",
    "WIDTH",
    "PatternCamera",
    "ReadFrame",
    "Reading",
    "StampedVehicle",
    "Steer",
    "read_frame",
]

WIDTH, HEIGHT, RATE = 1280, 720, 30


def read_frame(image: NDArray[np.uint8]) -> int:
    """What the analytics does with a frame: touch every cache line's share of it, no more."""
    return int(image.reshape(-1)[::64].sum(dtype=np.int64))


class PatternCamera:
    """A camera whose picture is there at once, so that only the way to the drone is measured."""

    model: CameraModel | None = None
    finished = False
    skipped = 0

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        self._seed = environment.simulation.seed
        self._id = sensor.id

    def open(self) -> None:
        """Draw the picture once."""
        _stamps.install()
        generator = np.random.default_rng(self._seed)
        self._image = generator.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)

    def capture(self, stamp: int, pose: Odometry | None) -> Picture:  # noqa: ARG002
        """Return the picture."""
        return Picture(self._image, stamp)

    def close(self) -> None:
        """Write the stamps."""
        _stamps.dump()


class StampedVehicle(SimulatedVehicle):
    """The simulated drone, in whose process stamps are taken."""

    def connect(self, timeout: float = 10.0) -> None:
        """Take stamps from now on, if asked for."""
        _stamps.install()
        super().connect(timeout)

    def close(self) -> None:
        """Write the stamps."""
        super().close()
        _stamps.dump()


@dataclass(frozen=True)
class Reading:
    """The result of reading a frame."""

    value: int


class _Stamped:
    """An analysis in whose process stamps are taken."""

    def open(self) -> None:
        """Take stamps from now on, if asked for."""
        _stamps.install()

    def close(self) -> None:
        """Write the stamps."""
        _stamps.dump()


class ReadFrame(_Stamped, Analytics[Reading]):
    """Reads the frame; no neural network."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Reading
    isolated = True

    def process(self, item: Frame, context: Context) -> Reading:  # noqa: ARG002
        """Sum a share of the pixels."""
        return Reading(read_frame(item.image))


class Steer(_Stamped, NavigableAnalytics):
    """Turns each reading into a velocity command."""

    accepts: ClassVar[tuple[type, ...]] = (Reading,)
    isolated = True

    def process(self, item: Reading, context: Context) -> AeroNavigation:  # noqa: ARG002
        """Stand still."""
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(valid_for=1.0)])
