"""Camera for recorded material: a folder of images, or a video file or URL."""

from __future__ import annotations

from pathlib import Path

from aerodaas.cameras.base import Camera
from aerodaas.cameras.folder import FolderCamera
from aerodaas.cameras.settings import camera_settings
from aerodaas.cameras.video import VideoCamera
from aerodaas.config.model import CameraConfig, EnvironmentConfig, SensorConfig

__all__ = ["recorded_camera"]


def recorded_camera(sensor: SensorConfig, environment: EnvironmentConfig) -> Camera:
    """Create the camera for the setting `path`.

    Args:
        sensor: The sensor, with its settings.
        environment: Its environment.

    Raises:
        ConfigError: For invalid settings.
    """
    path = camera_settings(sensor).path
    is_folder = path is None or Path(path.get_secret_value()).is_dir()
    kind = FolderCamera if is_folder else VideoCamera
    return kind(sensor, environment)


recorded_camera.settings_model = CameraConfig  # type: ignore[attr-defined]
