"""The newest picture of a video stream."""

from __future__ import annotations

import threading
import time
from typing import Any

import cv2
from numpy.typing import NDArray


class Video:
    """Reads a stream in a thread of its own, as reading waits for the next picture."""

    def __init__(self, url: str) -> None:
        self.capture = cv2.VideoCapture(url)
        self.frame: NDArray[Any] | None = None
        self.reading = True
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()

    def read(self) -> None:
        """Keep the newest picture."""
        while self.reading:
            fine, frame = self.capture.read()
            if fine:
                self.frame = frame

    def next(self, last: NDArray[Any] | None = None) -> NDArray[Any]:
        """Wait for a picture other than the last one."""
        while self.frame is None or self.frame is last:
            time.sleep(0.005)
        return self.frame

    def close(self) -> None:
        """Read no more."""
        self.reading = False
        self.thread.join()
