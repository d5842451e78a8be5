"""Cameras that play the images of an MCAP recording."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace

from aerodaas.cameras.base import Picture
from aerodaas.cameras.settings import camera_model, camera_settings, required_path
from aerodaas.config.model import CameraConfig, EnvironmentConfig, SensorConfig
from aerodaas.errors import RecordingError, SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.pictures import RecordedImage, decoded_ahead, picture_topics, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.steady_clock import SteadyClock

__all__ = ["McapCamera", "ReplayedCamera"]

_log = logging.getLogger(__name__)


class McapCamera:
    """Camera that plays a recording's images at their recorded rate, from the first one on.

    Settings: `path` of the MCAP file, `topic` if it holds images of several cameras, `loop`,
    and the lens and mount of `CameraConfig`. Reads Foxglove's CompressedImage, CompressedVideo
    (H.264) and RawImage, and ROS 2's sensor_msgs/CompressedImage and Image.
    """

    settings_model = CameraConfig

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        """Check the settings of `sensor`; raises ConfigError."""
        del environment
        self._settings = camera_settings(sensor)
        self._path = required_path(sensor, self._settings, "MCAP recording")
        self._model: CameraModel | None = None
        self._recording: Recording | None = None
        self._topic = ""
        self._shots: Iterator[RecordedImage] = iter(())
        self._next: RecordedImage | None = None
        self._clock = SteadyClock()
        self._time = 0
        """When `_next` was taken, nanoseconds by `_clock`."""
        self._offset: int | None = None
        self._skipped = 0

    @property
    def model(self) -> CameraModel | None:
        """Calibration for the size of the newest image; None before `open`."""
        return self._model

    @property
    def finished(self) -> bool:
        """True after the last image was returned; never for a recording that loops."""
        return self._next is None

    @property
    def skipped(self) -> int:
        """Number of images skipped because broken, or older than the preceding one."""
        return self._skipped

    def open(self) -> None:
        """Open the recording; raises SourceError if it has no images that can be decoded."""
        try:
            self._recording = Recording.open(self._path)
        except RecordingError as error:
            raise SourceError(str(error)) from None
        self._topic = self._choose(self._recording)
        self._rewind()
        for shot in shots(self._recording, [self._topic]):
            image = shot.image()
            if image is not None:
                self._model = camera_model(self._settings, image.shape[1], image.shape[0])
                return
        raise SourceError(f"none of the pictures on {self._topic} of {self._path} can be decoded")

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the newest image that is due.

        Args:
            stamp: Mission time, nanoseconds.
            pose: Ignored.

        Returns:
            The image; None if it was returned already or is broken.
        """
        del pose
        due: RecordedImage | None = None
        while self._next is not None and self._due_at(self._next, stamp) <= stamp:
            due = self._next
            self._advance(stamp)
        if due is None:
            return None
        image = due.image()
        if image is None:
            self._skipped += 1
            _log.warning("%s: skipped a broken picture on %s", self._path, self._topic)
            return None
        self._model = camera_model(self._settings, image.shape[1], image.shape[0])
        picture = Picture(image, stamp, self._topic, due.odometry, due.depth())
        return self._picture(picture, due)

    def close(self) -> None:
        """Close the recording, and end the threads that decode ahead."""
        self._shots = iter(())
        if self._recording is not None:
            self._recording.close()
            self._recording = None

    def _picture(self, picture: Picture, shot: RecordedImage) -> Picture:
        del shot
        return picture

    def _due_at(self, shot: RecordedImage, stamp: int) -> int:
        """Mission time at which the next image is due; the first one is due at once."""
        del shot
        if self._offset is None:
            self._offset = stamp - self._time
        return self._time + self._offset

    def _advance(self, stamp: int) -> None:
        for shot in self._shots:
            leaps = self._clock.leaps
            time = self._clock.steady(shot.record.captured)
            if self._clock.leaps > leaps == 0:
                _log.warning("%s: the clock was set; %s plays on", self._path, self._topic)
            if time < self._time:
                self._skipped += 1
                continue
            self._next, self._time = shot, time
            return
        self._next = None
        self._begin_again(stamp)

    def _begin_again(self, stamp: int) -> None:
        if self._settings.loop:
            self._rewind()
            # A nanosecond later, so that a recording of a single image is not always due.
            self._offset = stamp + 1 - self._time if self._next else None

    def _rewind(self) -> None:
        if self._recording is not None:
            self._shots = self._play(shots(self._recording, [self._topic], as_written=True))
            self._next = next(self._shots, None)
            self._clock = SteadyClock()
            self._time = self._clock.steady(self._next.record.captured) if self._next else 0

    def _play(self, found: Iterator[RecordedImage]) -> Iterator[RecordedImage]:
        return found

    def _choose(self, recording: Recording) -> str:
        topics = picture_topics(recording)
        if self._settings.topic in topics:
            return str(self._settings.topic)
        known = ", ".join(topics) or "none"
        if self._settings.topic is not None:
            raise SourceError(
                f"{self._path} has no pictures on {self._settings.topic}; it has: {known}"
            )
        if len(topics) != 1:
            raise SourceError(f'{self._path}: name the pictures\' "topic"; it has: {known}')
        return topics[0]


class ReplayedCamera(McapCamera):
    """Camera that plays a recording of this project at its recorded mission times.

    With `loop` it never reports that it has finished, as the recorded camera never did.
    """

    @property
    def finished(self) -> bool:
        """True after the last image was returned, unless the recorded camera was endless."""
        return super().finished and not self._settings.loop

    def _play(self, found: Iterator[RecordedImage]) -> Iterator[RecordedImage]:
        # Every image is played as fast as possible: decoding takes longest.
        return decoded_ahead(found)

    def _due_at(self, shot: RecordedImage, stamp: int) -> int:
        del stamp
        return shot.header.stamp

    def _begin_again(self, stamp: int) -> None:
        """Do nothing: mission time does not restart."""

    def _picture(self, picture: Picture, shot: RecordedImage) -> Picture:
        return replace(picture, stamp=shot.header.stamp)
