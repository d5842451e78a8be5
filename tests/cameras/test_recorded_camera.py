"""Which camera plays what was recorded: a folder's, or a video's."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerodaas.cameras.folder import FolderCamera
from aerodaas.cameras.recorded import recorded_camera
from aerodaas.cameras.video import VideoCamera
from aerodaas.config.model import CameraConfig, EnvironmentConfig, SensorConfig
from aerodaas.errors import ConfigError

ENVIRONMENT = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})


def sensor(**settings: object) -> SensorConfig:
    """A sensor of these settings."""
    return SensorConfig(id="cam", driver="recorded", settings=settings)


def test_a_folder_is_played_as_one_and_all_else_as_a_video(tmp_path: Path) -> None:
    """A file, one that is still missing, and an address are videos."""
    (tmp_path / "it.mp4").touch()
    assert isinstance(recorded_camera(sensor(path=str(tmp_path)), ENVIRONMENT), FolderCamera)
    for path in (f"{tmp_path}/it.mp4", f"{tmp_path}/missing", "rtsp://camera/1", "/dev/video0"):
        made = recorded_camera(sensor(path=path), ENVIRONMENT)
        assert isinstance(made, VideoCamera), path


@pytest.mark.parametrize("settings", [{}, {"path": None}, {"path": ""}])
def test_without_a_path_a_folder_or_a_video_is_asked_for(settings: dict[str, object]) -> None:
    """The sensor and the setting are named."""
    with pytest.raises(ConfigError, match=r'cam: settings: give the .* as "path"'):
        recorded_camera(sensor(**settings), ENVIRONMENT)


def test_settings_are_those_of_a_camera() -> None:
    """A wrong one is refused by name."""
    assert recorded_camera.settings_model is CameraConfig  # type: ignore[attr-defined]
    with pytest.raises(ConfigError, match="horizontal_fov"):
        recorded_camera(sensor(path="x", horizontal_fov=500), ENVIRONMENT)
