"""A camera and analyses that cost next to no computation, to be sent to a cluster."""

from __future__ import annotations

import time
from pathlib import Path
from typing import ClassVar

import numpy as np

from aerodaas import Analytics, Frame, Odometry
from aerodaas.analytics.base import Context
from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.geometry.frames import CameraModel

__all__ = ["Glance", "NoiseCamera"]


class NoiseCamera:
    """Pictures of noise, which cannot be compressed, at no cost."""

    model: CameraModel | None = None
    finished = False
    skipped = 0

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        self._seed = environment.simulation.seed
        self._id = sensor.id

    def open(self) -> None:
        """Draw the picture once: 58 kB."""
        generator = np.random.default_rng(self._seed)
        self._image = generator.integers(0, 255, (108, 180, 3), dtype=np.uint8)

    def capture(self, stamp: int, pose: Odometry | None) -> Picture:  # noqa: ARG002
        """Return the picture."""
        return Picture(self._image, stamp)

    def close(self) -> None:
        """Nothing to release."""


class Glance(Analytics[int]):
    """Takes 110 ms on the edge, 10 ms in the cloud; hangs on the edge while `stop` exists."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = int
    isolated = True
    scheduled = True

    def __init__(self, name: str, stop: Path) -> None:
        self.name = name
        self._stop = str(stop)

    def process(self, item: Frame, context: Context) -> int:
        """Return the frame's number."""
        time.sleep(0.11 if context.kind == "edge" else 0.01)
        while context.kind == "edge" and Path(self._stop).exists():
            time.sleep(0.05)
        return item.header.id
