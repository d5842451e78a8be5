"""VideoCamera: a video file, a network stream or a local camera device."""

from __future__ import annotations

import re

from aerodaas.cameras.base import Picture
from aerodaas.cameras.live import LiveSource
from aerodaas.cameras.settings import camera_model, camera_settings, required_path
from aerodaas.cameras.vehicle_addressed import TOLD, VehicleAddressedSource
from aerodaas.cameras.video_file import VideoFile
from aerodaas.config.model import CameraConfig, EnvironmentConfig, SensorConfig
from aerodaas.config.secrets import SecretUrl
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry

__all__ = ["VideoCamera"]

_LIVE = re.compile(r"^([a-z][a-z0-9+.\-]*://|/dev/video\d+$)", re.IGNORECASE)


class VideoCamera:
    """Plays a video file by mission time, or returns the newest frame of a live source.

    Settings: `path` (a file, a URL such as `rtsp://…` or `udp://…`, or `/dev/video0`; `mavlink`
    for where the MAVLink vehicle itself says that its video is), `loop` for files, and the lens and
    mount of `CameraConfig`.
    """

    settings_model = CameraConfig
    most_memory: int | None = None

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        """Validate the settings of `sensor`; raises ConfigError."""
        self._settings = camera_settings(sensor)
        path = SecretUrl(required_path(sensor, self._settings, "video file, URL or device"))
        self._label = str(path)
        self._source: VideoFile | LiveSource | VehicleAddressedSource
        if path.get_secret_value() == TOLD and environment.camera_driver(sensor) == "mavlink":
            self._source = VehicleAddressedSource(sensor.full_id)
        elif _LIVE.match(path.get_secret_value()):
            self._source = LiveSource(path)
        else:
            self._source = VideoFile(path, sensor.rate, loop=self._settings.loop)
        if not isinstance(self._source, VideoFile):
            self.most_memory = LiveSource.most_memory
        self._model: CameraModel | None = None

    @property
    def model(self) -> CameraModel | None:
        """Calibration for the size of the newest frame; None before the first."""
        return self._model

    @property
    def finished(self) -> bool:
        """Whether a file that does not loop has ended; always False for a live source."""
        return self._source.finished

    @property
    def skipped(self) -> int:
        """Number of frames that could not be decoded."""
        return self._source.skipped

    def open(self) -> None:
        """Open the source; raises SourceError if it returns no frame."""
        first = self._source.open()
        if first is not None:
            self._model = camera_model(self._settings, first.shape[1], first.shape[0])

    def follow_video(self, address: str) -> None:
        """Take the address that the vehicle tells, where the settings say so."""
        if isinstance(self._source, VehicleAddressedSource):
            self._source.follow(address)

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the newest frame.

        Args:
            stamp: Mission time, nanoseconds.
            pose: Ignored.

        Returns:
            The frame, or None if there is no new one.
        """
        del pose
        found = self._source.newest(stamp)
        if found is None:
            return None
        image, taken = found
        self._model = camera_model(self._settings, image.shape[1], image.shape[0])
        return Picture(image, taken, self._label)

    def close(self) -> None:
        """Release the source."""
        self._source.close()
