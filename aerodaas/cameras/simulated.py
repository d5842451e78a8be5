"""Simulated camera: renders the simulated world from the vehicle's true pose."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from aerodaas.cameras.base import Picture
from aerodaas.cameras.settings import camera_settings
from aerodaas.clock import seconds
from aerodaas.config.model import CameraConfig, EnvironmentConfig, SensorConfig
from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import GimbalAttitude, levelled, zoomed
from aerodaas.simulation.world import World

if TYPE_CHECKING:
    from aerodaas.simulation.renderer import Renderer

__all__ = ["SimulatedCamera"]


class SimulatedCamera:
    """A pinhole camera in the simulated world, which can turn and zoom.

    Raises ConfigError if the sensor's settings are not those of a `CameraConfig`, or if the
    environment's world is invalid.
    """

    settings_model = CameraConfig

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        """Validate the settings and load the world; the renderer starts in `open`."""
        config = camera_settings(sensor)
        self._name = sensor.id
        self._world = World.load(environment.simulation)
        self._mounted = self._model = CameraModel.from_fov(
            config.width,
            config.height,
            math.radians(config.horizontal_fov),
            mount=config.mount,
            pitch=math.radians(config.pitch),
            yaw=math.radians(config.yaw),
        )
        self._most_zoom = config.zoom
        self._gimbal: GimbalAttitude | None = None
        self._zoom = 1.0
        self._depth_range = config.depth_range
        self._renderer: Renderer | None = None

    @property
    def model(self) -> CameraModel:
        """Calibration and mount, as lens and gimbal had the camera at the newest image."""
        return self._model

    @property
    def finished(self) -> bool:
        """Always False, as a simulated camera does not end."""
        return False

    @property
    def skipped(self) -> int:
        """Always 0, as every rendered image is valid."""
        return 0

    def open(self) -> None:
        """Start the renderer; raises SourceError if that fails."""
        if self._renderer is None:
            # Imported late, because panda3d takes 0.2 s to import.
            from aerodaas.simulation.renderer import renderer_for  # noqa: PLC0415

            self._renderer = renderer_for(self._world, self._model, self._depth_range)

    def follow_gimbal(self, attitude: GimbalAttitude | None) -> None:
        """Look as the gimbal does at the next image."""
        self._gimbal = attitude

    def follow_zoom(self, percent: float | None) -> None:
        """See as the lens is set at the next image; None: as calibrated."""
        self._zoom = 1.0 + (self._most_zoom - 1.0) * (percent or 0.0) / 100.0

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Render a picture.

        Args:
            stamp: Mission time, nanoseconds.
            pose: True pose of the vehicle.

        Returns:
            The picture, or None while the pose is unknown.

        Raises:
            SourceError: If the camera is not open.
        """
        if self._renderer is None:
            raise SourceError(f"{self._name} is not open; call open first")
        if pose is None:
            return None
        if self._gimbal is not None or self._most_zoom > 1.0:
            model = zoomed(self._mounted, self._zoom)
            self._model = model if self._gimbal is None else levelled(model, self._gimbal, pose)
            self._renderer.orient(self._model)
        image = self._renderer.render(seconds(stamp), pose)
        return Picture(image, stamp, depth=self._renderer.depth())

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
