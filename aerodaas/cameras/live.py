"""Live video source: frames are decoded in a separate thread, and only the newest is kept.

For a reader slower than the frame rate, frames would otherwise queue in the decoder and age by
seconds, as users of Wi-Fi drones report.
"""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.config.secrets import SecretUrl
from aerodaas.types.clock import host_time_ns
from aerodaas.types.errors import SourceError

__all__ = ["LiveSource"]

_log = logging.getLogger(__name__)
_FIRST_FRAME_TIMEOUT = 10.0
_READ_TIMEOUT_MS = 3000
_SHORTEST_WAIT = 0.5
_LONGEST_WAIT = 8.0
_OPTIONS = "OPENCV_FFMPEG_CAPTURE_OPTIONS"
_MOST_PIXELS = 4096 * 4096
"""Pixels of the largest picture that is handed on: a stream may claim any size."""
_OPENING = threading.Lock()


class LiveSource:
    """Source of the newest frame of a URL (rtsp, udp, http, …) or device (/dev/video0)."""

    most_memory = 2 << 30
    """Bytes that its process may allocate. A picture of the largest size, decoded by 16 threads
    from 16 others, takes 0.8 GB; without a bound, a server that sends one frame without an end
    takes all memory of the machine, and the read timeout never strikes."""

    def __init__(
        self,
        address: SecretUrl,
        *,
        timeout: float = _FIRST_FRAME_TIMEOUT,
        protocols: str | None = None,
    ) -> None:
        """Read from `address`; `open` waits up to `timeout` seconds for the first frame.

        `protocols` are the only ones that FFmpeg may use for it, separated by commas; None for all.
        """
        self._address = address
        self._protocols = protocols
        self._timeout = timeout
        self._lock = threading.Lock()
        self._arrived = threading.Event()
        self._closing = threading.Event()
        self._frame: tuple[NDArray[np.uint8], int] | None = None
        self._thread: threading.Thread | None = None
        self.finished = False
        """Always False: a source that times out is reconnected."""
        self.skipped = 0
        self.reconnections = 0
        self._frames = 0
        """Frames decoded so far."""

    def start(self) -> None:
        """Start decoding."""
        self._thread = threading.Thread(target=self._decode, name="live-source", daemon=True)
        self._thread.start()

    def open(self) -> NDArray[np.uint8]:
        """Start decoding and return the first frame; raises SourceError without one."""
        self.start()
        if not self._arrived.wait(self._timeout):
            self.close()
            message = (
                f"no picture from {self._address} within {self._timeout:g} s; check that it is "
                "switched on and reachable, and that `ffplay` can show it"
            )
            raise SourceError(message)
        with self._lock:
            if self._frame is None:
                message = f"{self._address} ended before its first picture"
                raise SourceError(message)
            return self._frame[0]

    def newest(self, stamp: int) -> tuple[NDArray[np.uint8], int] | None:
        """Return the newest unread frame with its capture time: `stamp` minus the frame's age."""
        with self._lock:
            frame, self._frame = self._frame, None
        if frame is None:
            return None
        image, grabbed = frame
        return image, max(0, stamp - (host_time_ns() - grabbed))

    def close(self) -> None:
        """Stop decoding."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join(timeout=_READ_TIMEOUT_MS / 1000)

    def _decode(self) -> None:
        wait = _SHORTEST_WAIT
        while not self._closing.is_set():
            capture = _connect(self._address.get_secret_value(), self._protocols)
            before = self._frames
            try:
                self._drain(capture)
            except (cv2.error, MemoryError):
                # No memory for what the stream says it sends.
                self.skipped += 1
            if self._frames > before:
                wait = _SHORTEST_WAIT
            capture.release()
            if self._closing.wait(wait):
                return
            self.reconnections += 1
            _log.warning("%s is silent; connecting again", self._address)
            wait = min(2 * wait, _LONGEST_WAIT)

    def _drain(self, capture: cv2.VideoCapture) -> None:
        """Read frames until the source ends or times out."""
        while not self._closing.is_set() and capture.grab():
            grabbed = host_time_ns()
            width, height = map(capture.get, (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
            readable, image = (
                capture.retrieve() if width * height <= _MOST_PIXELS else (False, None)
            )
            if not readable:
                self.skipped += 1
                continue
            with self._lock:
                self._frame = (np.asarray(image, np.uint8), grabbed)
            self._frames += 1
            self._arrived.set()


def _connect(address: str, protocols: str | None) -> cv2.VideoCapture:
    device = address.removeprefix("/dev/video")
    if device != address and device.isdigit():
        return cv2.VideoCapture(int(device), cv2.CAP_V4L2)
    timeouts: Sequence[int] = [
        cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
        _READ_TIMEOUT_MS,
        cv2.CAP_PROP_READ_TIMEOUT_MSEC,
        _READ_TIMEOUT_MS,
    ]
    with _low_latency(protocols):
        return cv2.VideoCapture(address, cv2.CAP_FFMPEG, timeouts)


@contextmanager
def _low_latency(protocols: str | None) -> Iterator[None]:
    """Disable FFmpeg's buffering for captures opened within this context.

    `protocols` are the only ones that it may use, whatever else the environment says.

    OpenCV takes FFmpeg's options from the environment only, where they would also affect files
    that are opened later.
    """
    with _OPENING:
        before = os.environ.get(_OPTIONS)
        os.environ.setdefault(_OPTIONS, "rtsp_transport;tcp|fflags;nobuffer|flags;low_delay")
        if protocols is not None:
            os.environ[_OPTIONS] += f"|protocol_whitelist;{protocols}"
        try:
            yield
        finally:
            if before is None:
                del os.environ[_OPTIONS]
