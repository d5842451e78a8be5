"""Settings of a camera's driver, from its sensor's entry."""

from __future__ import annotations

import math

from aerodaas.config.checked import checked
from aerodaas.config.model import CameraConfig, SensorConfig
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import CameraModel

__all__ = ["camera_model", "camera_settings", "required_path"]


def camera_settings(sensor: SensorConfig) -> CameraConfig:
    """Validate the settings of `sensor`; raises ConfigError naming the sensor and the setting."""
    return checked(CameraConfig, sensor.settings, f"sensor {sensor.full_id}: settings")


def required_path(sensor: SensorConfig, settings: CameraConfig, what: str) -> str:
    """Return the path among the settings of a camera.

    Args:
        sensor: The sensor, for the error.
        settings: Its settings.
        what: What the path is of, for the error.

    Raises:
        ConfigError: If it is missing.
    """
    path = "" if settings.path is None else settings.path.get_secret_value()
    if not path:
        message = f'sensor {sensor.full_id}: settings: give the {what} as "path"'
        raise ConfigError(message)
    return path


def camera_model(settings: CameraConfig, width: int, height: int) -> CameraModel:
    """Make the pinhole model of a camera's images, with the mount's pose.

    Args:
        settings: Settings of the camera; its angles are in degrees.
        width: Pixels.
        height: Pixels.
    """
    return CameraModel.from_fov(
        width,
        height,
        math.radians(settings.horizontal_fov),
        mount=settings.mount,
        pitch=math.radians(settings.pitch),
        yaw=math.radians(settings.yaw),
    )
