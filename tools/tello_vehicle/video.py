"""The emulated Tello's camera: images, real H.264, packets of 1460 bytes."""

from __future__ import annotations

import contextlib
import logging
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from fractions import Fraction

import av
from av.video.codeccontext import VideoCodecContext

from aerodaas.messages.odometry import Odometry
from aerodaas.testing.channel import Channel
from tools.tello_vehicle.options import TelloOptions, VideoOptions
from tools.tello_vehicle.pictures import picture_source

__all__ = ["VideoStream", "packets"]

_log = logging.getLogger(__name__)

_LONGEST = 1460
"""Bytes of a video packet; a shorter one ends a frame."""
_START_CODE = re.compile(rb"\x00\x00\x01")
_LONG_CODE = b"\x00\x00\x00\x01"
_FOR_PLAYERS = frozenset({6, 9})
"""Units that x264 writes and a Tello does not: its own description, delimiters."""


class VideoStream:
    """Films in a thread of its own from `start` to `stop`, and sends to every one of `peers`."""

    def __init__(
        self,
        options: TelloOptions,
        peers: tuple[tuple[str, int], ...],
        pose: Callable[[], Odometry],
    ) -> None:
        """Film what `pose` sees."""
        self._options = options
        self._peers = peers
        self._pose = pose
        self.began: float | None = None
        """Monotonic second at which the film began; the filmed world's time is zero then."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="emulated-video", daemon=True)

    def start(self) -> None:
        """Start filming."""
        self._thread.start()

    def stop(self) -> None:
        """Stop filming, perhaps within a frame."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        video = self._options.video
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out,
            picture_source(video) as picture,
        ):

            def transmit(content: bytes, peer: tuple[str, int]) -> None:
                with contextlib.suppress(OSError):
                    out.sendto(content, peer)

            seed = f"{self._options.seed}/video"
            channels = [
                (peer, Channel(self._options.video_link, f"{seed}/{index}", transmit))
                for index, peer in enumerate(self._peers)
            ]
            encoder = _encoder(video)
            began = self.began = time.monotonic()
            index = 0
            while not self._stopping.is_set():
                image = picture(time.monotonic() - began, self._pose())
                frame = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format="yuv420p")
                frame.pts = index
                for encoded in encoder.encode(frame):
                    for content in packets(bytes(encoded)):
                        for peer, channel in channels:
                            channel.send(content, peer, time.monotonic())
                index = max(index + 1, int((time.monotonic() - began) * video.rate))
                due = began + index / video.rate
                while not self._stopping.is_set() and (left := due - time.monotonic()) > 0.0:
                    for _, channel in channels:
                        channel.deliver(time.monotonic())
                    self._stopping.wait(min(left, 0.005))


def _encoder(video: VideoOptions) -> VideoCodecContext:
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height = video.width, video.height
    encoder.pix_fmt = "yuv420p"
    encoder.time_base = Fraction(1, round(video.rate))
    encoder.framerate = Fraction(round(video.rate), 1)
    encoder.bit_rate = video.bit_rate
    encoder.gop_size = video.key_interval
    encoder.thread_count = 1
    # One slice a frame, no B frames, headers before each key frame, as the Tello's own encoder.
    encoder.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "x264-params": "repeat-headers=1:sliced-threads=0:slices=1:scenecut=0",
    }
    return encoder


def packets(frame: bytes) -> Iterator[bytes]:
    """Cut an encoded frame as a Tello does: headers in packets of their own, then pieces."""
    starts = [match.start() for match in _START_CODE.finditer(frame)]
    for start, end in zip(starts, [*starts[1:], len(frame)], strict=True):
        unit = b"\x00" + frame[start:end].rstrip(b"\x00")
        if unit[len(_LONG_CODE)] & 0x1F in _FOR_PLAYERS:
            continue
        yield from (unit[at : at + _LONGEST] for at in range(0, len(unit), _LONGEST))
