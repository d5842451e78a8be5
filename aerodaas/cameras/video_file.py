"""Deterministic playback of a video file by mission time."""

from __future__ import annotations

import logging
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.config.secrets import SecretUrl
from aerodaas.types.clock import seconds
from aerodaas.types.errors import SourceError

__all__ = ["VideoFile"]

_log = logging.getLogger(__name__)
# The timestamp of frame k in nanoseconds lies up to one nanosecond below k / rate.
_ROUNDING = 1e-4


class VideoFile:
    """Plays a video at its own frame rate, by mission time."""

    def __init__(self, path: SecretUrl, fallback_rate: float, *, loop: bool) -> None:
        """Play `path`; `fallback_rate` in Hz is for files without a frame rate."""
        self._path = path
        self._rate = fallback_rate
        self._loop = loop
        self._capture: cv2.VideoCapture | None = None
        self._start: int | None = None
        self._position = -1
        self._first: NDArray[np.uint8] | None = None
        self.finished = False
        self.skipped = 0

    def open(self) -> NDArray[np.uint8]:
        """Open the file and return its first frame; raises SourceError."""
        self._capture = cv2.VideoCapture(self._path.get_secret_value())
        rate = self._capture.get(cv2.CAP_PROP_FPS) if self._capture.isOpened() else 0.0
        readable, image = self._capture.read()
        if not readable:
            message = (
                f"cannot decode the video {self._path}: it is missing, damaged or in a codec that "
                "OpenCV lacks; convert it with `ffmpeg -i IN -c:v libx264 OUT.mp4`"
            )
            raise SourceError(message)
        if math.isfinite(rate) and rate > 0:
            self._rate = rate
        else:
            _log.warning("%s states no rate; played at %g Hz", self._path, self._rate)
        self._first = np.asarray(image, np.uint8)
        return self._first

    def newest(self, stamp: int) -> tuple[NDArray[np.uint8], int] | None:
        """Return the frame due at `stamp`, with that timestamp; None if returned already."""
        if self._start is None:
            self._start = stamp
        due = math.floor(seconds(stamp - self._start) * self._rate + _ROUNDING)
        if due <= self._position or self.finished or self._capture is None:
            return None
        if self._position < 0 and due == 0 and self._first is not None:
            self._position = 0
            return self._first, stamp
        # `open` has read frame 0, so the decoder is positioned after it.
        self._position = max(self._position, 0)
        while self._position < due:
            if not self._advance():
                return None
        readable, image = self._capture.retrieve()
        if not readable:
            self.skipped += 1
            _log.warning("%s: skipped frame %d, it cannot be decoded", self._path, due)
            return None
        return np.asarray(image, np.uint8), stamp

    def close(self) -> None:
        """Close the file."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None

    def _advance(self) -> bool:
        """Grab the next frame; a video that loops restarts at its end."""
        if self._capture is None:
            return False
        if not self._capture.grab():
            if not self._loop:
                self.finished = True
                return False
            self._capture.release()
            self._capture = cv2.VideoCapture(self._path.get_secret_value())
            if not self._capture.grab():
                self.finished = True
                return False
        self._position += 1
        return True
