"""FolderCamera: playback of a folder of images as a camera."""

from __future__ import annotations

import logging
import math
import re
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.base import Picture
from aerodaas.cameras.picture_size import picture_format, picture_size
from aerodaas.cameras.settings import camera_model, camera_settings, required_path
from aerodaas.clock import seconds
from aerodaas.config.model import CameraConfig, EnvironmentConfig, SensorConfig
from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry

__all__ = ["FolderCamera"]

_log = logging.getLogger(__name__)
_MOST_PIXELS = 100_000_000
"""Pixels of the largest picture: a small file may claim gigabytes of them."""
_KINDS = {".jpg", ".jpeg", ".png", ".bmp", ".webp"}


class FolderCamera:
    """Plays the images of a folder at the sensor's rate, in natural order of their names.

    Settings: `path` of the folder, `loop`, and the lens and mount of `CameraConfig`. The image
    returned depends on mission time only. Grey, 16-bit and transparent images are converted to
    8-bit BGR; their sizes may differ.
    """

    settings_model = CameraConfig

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        """Validate the settings of `sensor`; raises ConfigError."""
        del environment
        self._settings = camera_settings(sensor)
        self._folder = Path(required_path(sensor, self._settings, "folder of pictures"))
        self._rate = sensor.rate
        self._files: list[Path] = []
        self._broken: set[Path] = set()
        self._model: CameraModel | None = None
        self._start: int | None = None
        self._played = -1

    @property
    def model(self) -> CameraModel | None:
        """Calibration for the size of the newest image; None before `open`."""
        return self._model

    @property
    def finished(self) -> bool:
        """Whether the last image was returned; always False for a folder that loops."""
        return not self._settings.loop and self._played >= len(self._files) - 1

    @property
    def skipped(self) -> int:
        """Number of files without a readable image."""
        return len(self._broken)

    def open(self) -> None:
        """List the images; raises SourceError if none is readable."""
        try:
            files = [path for path in self._folder.iterdir() if path.suffix.lower() in _KINDS]
        except OSError as error:
            message = (
                f"cannot read the folder of pictures {self._folder}: {error.strerror}; "
                "give an existing folder as the sensor's path"
            )
            raise SourceError(message) from None
        self._files = sorted(files, key=_natural)
        if not self._files:
            kinds = ", ".join(sorted(_KINDS))
            message = f"the folder {self._folder} holds no pictures; put {kinds} files there"
            raise SourceError(message)
        pictures = (self._read(path) for path in self._files)
        first = next((image for image in pictures if image is not None), None)
        if first is None:
            message = (
                f"none of the {len(self._files)} pictures in {self._folder} can be read; "
                "copy them again"
            )
            raise SourceError(message)
        self._model = camera_model(self._settings, first.shape[1], first.shape[0])

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the image that is due.

        Args:
            stamp: Mission time, nanoseconds.
            pose: Ignored.

        Returns:
            The image; None if it was returned already or is broken.
        """
        del pose
        if self._start is None:
            self._start = stamp
        # The nearest, so that a jittering timestamp neither repeats nor skips an image.
        turn = round(seconds(stamp - self._start) * self._rate)
        if turn <= self._played or self.finished:
            return None
        last = len(self._files) - 1
        self._played = turn if self._settings.loop else min(turn, last)
        path = self._files[self._played % len(self._files)]
        image = self._read(path)
        if image is None:
            return None
        self._model = camera_model(self._settings, image.shape[1], image.shape[0])
        return Picture(image, stamp, path.name)

    def close(self) -> None:
        """Do nothing, as no file is kept open."""

    def _read(self, path: Path) -> NDArray[np.uint8] | None:
        image = _decode(path)
        if image is None and path not in self._broken:
            self._broken.add(path)
            _log.warning("skipped %s: it is no readable picture", path)
        return image


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key that orders frame_2 before frame_10."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(int(part), "") if part.isdigit() else (0, part) for part in parts]


def _decode(path: Path) -> NDArray[np.uint8] | None:
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if not content or _is_cut_short(content) or _pixels(content) > _MOST_PIXELS:
        return None
    try:
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, np.uint8)


def _pixels(content: bytes) -> float:
    """Pixels that the header of a picture claims; infinite if it is no picture's."""
    if content.startswith(b"BM"):
        sides = (content[18:22], content[22:26])
        return abs(math.prod(int.from_bytes(one, "little", signed=True) for one in sides))
    return math.prod(picture_size(content) or (math.inf,))


def _is_cut_short(content: bytes) -> bool:
    """Whether a JPEG lacks its end marker: OpenCV silently fills a missing part with grey.

    Only the second half counts, because a thumbnail before the image has a marker, too.
    """
    is_jpeg = picture_format(content) == "jpeg"
    return is_jpeg and content.rfind(b"\xff\xd9") < len(content) // 2
