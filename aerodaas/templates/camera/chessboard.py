"""A camera of your own: shows a chessboard that changes its colours once a second."""

import numpy as np

from aerodaas import Odometry
from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.geometry.frames import CameraModel


class Chessboard:
    """Named by the environment file's `driver`, as `chessboard:Chessboard`."""

    model: CameraModel | None = None  # calibration and mount, where known
    finished = False  # True once there will be no more pictures
    skipped = 0  # pictures that could not be read

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:  # noqa: ARG002
        """Take the sensor's settings from the environment file."""
        self.squares = int(sensor.settings.get("squares", 8))

    def open(self) -> None:
        """Start the source; raise SourceError that names the place and the remedy."""

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:  # noqa: ARG002
        """Return the newest picture, or None if there is no new one; `stamp` is now, in ns."""
        rows, columns = np.indices((self.squares, self.squares))
        light = (rows + columns + stamp // 1_000_000_000) % 2 == 0
        board = np.kron(light, np.ones((32, 32), dtype=bool))
        image = np.where(board, 240, 20).astype(np.uint8)
        return Picture(np.repeat(image[..., None], 3, axis=2), stamp)

    def close(self) -> None:
        """Release the source."""
