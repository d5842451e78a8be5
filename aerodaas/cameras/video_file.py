"""Deterministic playback of a video file by mission time."""

from __future__ import annotations

import logging
import os

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.config.secrets import SecretUrl
from aerodaas.errors import SourceError

__all__ = ["VideoFile"]

_log = logging.getLogger(__name__)
# Whoever opens a damaged file is told once, by us. OpenCV reads this at the first file.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
_HIGHEST_RATE = 500.0
"""Hz above which a file's rate, or its frames' stamps, are the ticks of its clock at best."""
_ROUNDING = 1e-6
"""Seconds by which a stamp may be rounded."""


class VideoFile:
    """Plays a video by mission time: each frame at its own stamp, whatever the file's rate."""

    def __init__(self, path: SecretUrl, fallback_rate: float, *, loop: bool) -> None:
        """Play `path`; `fallback_rate` in Hz is for files without a frame rate."""
        self._path = path
        self._loop = loop
        self._capture: cv2.VideoCapture | None = None
        self._start: int | None = None
        self._image: NDArray[np.uint8] | None = None
        """The next frame, if `open` has read it."""
        self._due: float | None = 0.0
        """Seconds of playback at which the next frame is due; None behind the last."""
        self._begun = 0.0
        """Seconds of playback at which the frame before was due."""
        self._period = 1.0 / fallback_rate
        """Seconds that a frame lasts behind which no stamp follows."""
        self._offset = 0.0
        """Seconds of playback less a frame's stamp."""
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
        if 0.0 < rate <= _HIGHEST_RATE:
            self._period = 1.0 / rate
        else:
            told = 1.0 / self._period
            _log.warning("%s states no rate; frames without stamps play at %g Hz", self._path, told)
        self._offset = -self._stamp()
        self._image = np.asarray(image, np.uint8)
        return self._image

    def newest(self, stamp: int) -> tuple[NDArray[np.uint8], int] | None:
        """Return the frame due at `stamp`, with that timestamp; None if returned already."""
        if self._start is None:
            self._start = stamp
        now = seconds(stamp - self._start) + _ROUNDING
        newest = None
        while self._due is not None and self._due <= now:
            newest = self._read() if self._image is None else self._image
            self._image = None
            self._begun = self._due
            self._due = self._advance()
        self.finished = self._due is None and self._begun + self._period <= now
        return None if newest is None else (newest, stamp)

    def close(self) -> None:
        """Close the file."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None
        self._due = None

    def _stamp(self) -> float:
        """The stamp of the frame that was grabbed last, seconds."""
        return 0.0 if self._capture is None else self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0

    def _read(self) -> NDArray[np.uint8] | None:
        """The frame that was grabbed last."""
        readable, image = (False, None) if self._capture is None else self._capture.retrieve()
        if not readable:
            self.skipped += 1
            _log.warning("%s: skipped a frame that cannot be decoded", self._path)
            return None
        return np.asarray(image, np.uint8)

    def _advance(self) -> float | None:
        """Grab the next frame and return when it is due; None behind the last.

        A video that loops begins again at its end.
        """
        if self._capture is None:
            return None
        following = self._begun + self._period
        if not self._capture.grab():
            if not self._loop:
                return None
            self._capture.release()
            self._capture = cv2.VideoCapture(self._path.get_secret_value())
            if not self._capture.grab():
                return None
            self._offset = following - self._stamp()
        due = self._stamp() + self._offset
        if due < self._begun + 1.0 / _HIGHEST_RATE:
            # No stamp, or one of a clock that was set back: it follows at the usual rate.
            self._offset += following - due
            return following
        self._period = min(self._period, due - self._begun)
        return due
