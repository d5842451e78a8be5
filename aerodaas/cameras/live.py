"""Live video source: frames are decoded in a separate thread, and only the newest is kept.

For a reader slower than the frame rate, frames would otherwise queue in the decoder and age by
seconds, as users of Wi-Fi drones report. Pictures that a loss has smeared are left out: whoever
follows a person by them would fly somewhere else.
"""

from __future__ import annotations

import logging
import threading

import av
import cv2
import numpy as np
from av.codec.context import Flags
from av.error import FFmpegError
from numpy.typing import NDArray

from aerodaas.cameras.h264 import FrameDecoder, bgr_image
from aerodaas.clock import host_time_ns
from aerodaas.config.secrets import SecretUrl
from aerodaas.errors import SourceError

__all__ = ["LiveSource"]

_log = logging.getLogger(__name__)
_FIRST_FRAME_TIMEOUT = 10.0
_READ_TIMEOUT = 3.0
_SHORTEST_WAIT = 0.5
_LONGEST_WAIT = 8.0
_OPTIONS = {"rtsp_flags": "prefer_tcp", "fpsprobesize": "0"}
"""FFmpeg's: RTSP by TCP, which loses nothing, or by UDP where a camera has only that. The rate of
frames is not measured first, which takes a second; `nobuffer` would drop the first key frame."""
_MOST_PIXELS = 4096 * 4096
"""Pixels of the largest picture that is handed on: a stream may claim any size."""


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
        """Frames that were left out: damaged, or waiting for a key frame after a loss."""
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
            self._thread.join(timeout=_READ_TIMEOUT)

    def _decode(self) -> None:
        wait = _SHORTEST_WAIT
        address = self._address.get_secret_value()
        device = address.removeprefix("/dev/video")
        while not self._closing.is_set():
            before = self._frames
            try:
                if device != address and device.isdigit():
                    self._read_device(int(device))
                else:
                    self._read_stream(address)
            except (cv2.error, MemoryError):
                # No memory for what the stream says it sends.
                self.skipped += 1
            except FFmpegError as error:
                _log.debug("%s: %s", self._address, error)
            if self._frames > before:
                wait = _SHORTEST_WAIT
            if self._closing.wait(wait):
                return
            self.reconnections += 1
            _log.warning("%s is silent; connecting again", self._address)
            wait = min(2 * wait, _LONGEST_WAIT)

    def _read_device(self, number: int) -> None:
        """Read pictures until the device ends."""
        capture = cv2.VideoCapture(number, cv2.CAP_V4L2)
        try:
            while not self._closing.is_set() and capture.grab():
                grabbed = host_time_ns()
                readable, image = capture.retrieve()
                if readable:
                    self._show(np.asarray(image, np.uint8), grabbed)
                else:
                    self.skipped += 1
        finally:
            capture.release()

    def _read_stream(self, address: str) -> None:
        """Read pictures until the stream ends; raises FFmpegError for all that goes wrong."""
        options = {**_OPTIONS, "max_pixels": str(_MOST_PIXELS)}
        if self._protocols is not None:
            options["protocol_whitelist"] = self._protocols
        with av.open(
            address,
            options=options,
            timeout=(_READ_TIMEOUT, _READ_TIMEOUT),
            metadata_errors="replace",
        ) as container:
            stream = next(iter(container.streams.video), None)
            if stream is None:
                return
            codec = stream.codec_context
            # Frame threading would delay frames.
            codec.thread_type = "SLICE"
            codec.flags |= Flags.low_delay
            decoder = FrameDecoder(codec, most_pixels=_MOST_PIXELS)
            left_out = self.skipped
            for packet in container.demux(stream):
                if self._closing.is_set() or not packet.size:
                    return
                arrived = host_time_ns()
                pictures = decoder.decode(packet)
                self.skipped = left_out + decoder.broken + decoder.waiting
                if pictures:
                    self._show(bgr_image(pictures[-1]), arrived)

    def _show(self, image: NDArray[np.uint8], taken: int) -> None:
        with self._lock:
            self._frame = (image, taken)
        self._frames += 1
        self._arrived.set()
