"""Export of a camera's images as MP4 (H.264) with their capture times."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.errors import RecordingError
from aerodaas.messages.frames import Frame
from aerodaas.recording.new_file import file_name, new_file
from aerodaas.recording.pictures import detections_by_frame, frames
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.overlay import draw_detections, draw_line

__all__ = ["VideoFile", "write_videos"]

_TICKS = 90_000
"""Units of the video's clock per second, as in MPEG."""
_LONGEST_GAP = (1 << 31) - 1
"""Units between two images, six hours and a half: MP4 counts them in 32 bits."""
_QUALITY = {"crf": "23", "preset": "veryfast"}


def write_videos(recording: Recording, folder: Path, *, overlays: bool = True) -> list[Path]:
    """Write an MP4 file for each camera.

    Args:
        recording: An open recording.
        folder: Folder of the new files, created if necessary.
        overlays: Draw detections, the mission time and the mission state into the images.

    Returns:
        The files.

    Raises:
        RecordingError: If the recording has no images, or a file exists or cannot be created.
    """
    writers: dict[str, VideoFile] = {}
    found = detections_by_frame(recording) if overlays else {}
    flight = RecordedFlight.read(recording)
    try:
        for frame in frames(recording):
            source = frame.header.source
            if source not in writers:
                path = new_file(folder / f"{file_name(source) or 'camera'}.mp4")
                writers[source] = VideoFile(path, frame)
            image = frame.image
            if overlays:
                image = image.copy()
                draw_detections(image, found.get((source, frame.header.stamp), ()))
                draw_line(image, _caption(flight, frame))
            writers[source].add(image, frame.header.stamp)
        for writer in writers.values():
            writer.finish()
    finally:
        for writer in writers.values():
            writer.close()
    if not writers:
        raise RecordingError(f"{recording.path} holds no pictures; were they switched off?")
    return [writer.path for writer in writers.values()]


def _caption(flight: RecordedFlight, frame: Frame) -> str:
    now = seconds(frame.header.stamp)
    robot = flight.robots.get(frame.header.source.partition("/")[0])
    state = robot.state_at(np.array([now]))[0].replace("_", " ") if robot else ""
    return f"{now:.1f} s  {state}"


class VideoFile:
    """Writer of one MP4 file."""

    def __init__(self, path: Path, first: Frame) -> None:
        import av  # noqa: PLC0415 - 30 MB that reports do without
        from av.error import FFmpegError  # noqa: PLC0415

        self.path = path
        self._error = FFmpegError
        self._frame = av.VideoFrame
        self._container = av.open(str(path), "w", options={"movflags": "+faststart"})
        # H.264 halves the colours' resolution, hence sizes must be even.
        self.size = first.width // 2 * 2, first.height // 2 * 2
        """Width and height in pixels."""
        stream = self._container.add_stream("libx264", options=_QUALITY)
        stream.width, stream.height = self.size
        stream.pix_fmt = "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, _TICKS)
        self._stream: Any = stream
        self._start = first.header.stamp
        self._last = -1

    def add(self, image: NDArray[np.uint8], stamp: int) -> None:
        """Add an image; one that is not later than the last is left out.

        A gap of hours, as a false time makes, is shortened to a second.

        Args:
            image: Picture, height x width x 3, BGR.
            stamp: Its time, nanoseconds.
        """
        width, height = self.size
        ticks = ((stamp - self._start) * _TICKS + NANOSECONDS // 2) // NANOSECONDS
        if ticks <= self._last or image.shape[0] < height or image.shape[1] < width:
            return
        if ticks - self._last > _LONGEST_GAP:
            self._start += (ticks - self._last - _TICKS) * NANOSECONDS // _TICKS
            ticks = self._last + _TICKS
        self._last = ticks
        frame = self._frame.from_ndarray(np.ascontiguousarray(image[:height, :width]), "bgr24")
        frame.pts, frame.time_base = ticks, self._stream.time_base
        self._write(frame)

    def finish(self) -> None:
        """Write what the encoder still holds."""
        self._write(None)

    def close(self) -> None:
        """Close the file, whole or not."""
        with suppress(self._error):
            self._container.close()

    def _write(self, frame: Any | None) -> None:  # noqa: ANN401 - PyAV is not loaded yet
        try:
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except (self._error, ValueError) as error:
            raise RecordingError(
                f"cannot write {self.path}: the encoder refuses pictures of {self.size[0]} x "
                f"{self.size[1]} pixels, or their times ({error})"
            ) from None
