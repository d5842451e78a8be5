"""H.264 encoder and decoder for Foxglove's CompressedVideo.

One frame per message, Annex B, no B-frames, parameter sets before every key frame, so that a
reader can start at any key frame. PyAV is imported only when video is used.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import RecordingError

if TYPE_CHECKING:
    from av.video.codeccontext import VideoCodecContext
    from av.video.frame import VideoFrame

__all__ = ["H264Decoder", "H264Encoder", "is_key_frame", "require_encoder"]

KEY_FRAME_NS = NANOSECONDS
"""Mission time between key frames, the most that a seek must decode; nanoseconds."""
_ENCODER = "libx264"
_UNIT = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)
_PICTURE = frozenset({1, 5})
"""Types of the NAL units that are slices of an image (ITU-T H.264, table 7-1)."""
_KEY = 5
_TICKS = 90_000


def require_encoder() -> None:
    """Raise RecordingError if FFmpeg was built without the libx264 encoder."""
    import av.codec  # noqa: PLC0415 - 30 MB that other recordings do without

    if _ENCODER not in av.codec.codecs_available:
        raise RecordingError(
            f'this PyAV has no {_ENCODER}; install a wheel of it ("pip install av"), '
            'or record with "images": "jpeg"'
        )


class H264Encoder:
    """H.264 encoder for one camera's images of one size, without lookahead."""

    def __init__(self, width: int, height: int, quality: int) -> None:
        """Encode images of `width` x `height` pixels at x264's constant rate factor `quality`.

        Odd sizes are padded by a pixel, because colours have half the resolution.
        """
        import av  # noqa: PLC0415 - as above
        from av.error import FFmpegError  # noqa: PLC0415

        self.size = width, height
        self._border = height % 2, width % 2
        codec = cast("VideoCodecContext", av.CodecContext.create(_ENCODER, "w"))
        codec.width, codec.height = width + width % 2, height + height % 2
        codec.pix_fmt = "yuv420p"
        codec.time_base = Fraction(1, _TICKS)
        # OpenCV converts with the standard-definition matrix at every size.
        codec.colorspace, codec.color_range = 6, 1
        codec.max_b_frames = 0
        codec.thread_count = 1
        # Key frames come by mission time, not by number.
        codec.gop_size = 1 << 20
        codec.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "crf": str(quality),
            "forced-idr": "1",
            "sc_threshold": "0",
        }
        self._codec = codec
        self._frame = av.VideoFrame
        self._key_type = 1
        self._error = FFmpegError
        self._last = -1
        self._next_key: int | None = None

    def encode(self, image: NDArray[np.uint8], stamp: int) -> bytes:
        """Encode an image.

        After an image that cannot be encoded, the next one is a key frame.

        Args:
            image: Picture, height x width x 3, BGR.
            stamp: Mission time of capture, nanoseconds.

        Raises:
            ValueError: If the image cannot be encoded.
        """
        key = self._next_key is None or not self._next_key - KEY_FRAME_NS <= stamp < self._next_key
        self._next_key = stamp + KEY_FRAME_NS if key else self._next_key
        below, right = self._border
        if below or right:
            image = np.asarray(
                cv2.copyMakeBorder(image, 0, below, 0, right, cv2.BORDER_REPLICATE), np.uint8
            )
        planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420), np.uint8)
        frame = self._frame.from_ndarray(planes, "yuv420p")
        self._last = max(self._last + 1, stamp * _TICKS // NANOSECONDS)
        frame.pts, frame.time_base = self._last, self._codec.time_base
        frame.pict_type = self._key_type if key else 0
        try:
            packets = self._codec.encode(frame)
        except self._error as error:
            self._next_key = None
            raise ValueError(f"H.264: {error}") from None
        return b"".join(bytes(packet) for packet in packets)


def is_key_frame(data: bytes) -> bool:
    """Return whether decoding can start at the frame `data` (H.264, Annex B)."""
    for unit in _UNIT.finditer(data):
        kind = unit[1][0] & 0x1F
        if kind in _PICTURE:
            return kind == _KEY
    return False


class H264Decoder:
    """Decoder for any frame of a video, given the frames since its key frame.

    Frames requested in order are decoded once each; a frame requested out of order is decoded
    from its key frame again.
    """

    def __init__(self) -> None:
        self._group: Sequence[bytes] | None = None
        self._done = 0
        """Number of frames of the group decoded so far."""
        self._picture: VideoFrame | None = None

    def decode(self, group: Sequence[bytes], place: int) -> NDArray[np.uint8] | None:
        """Decode one frame of a group to BGR.

        Args:
            group: Frames in order, of which the first is a key frame.
            place: Index of the frame.

        Returns:
            Height x width x 3, or None for a frame that is broken or depends on a broken one.
        """
        from av.packet import Packet  # noqa: PLC0415 - as above

        from aerodaas.cameras.h264 import FrameDecoder  # noqa: PLC0415 - loads PyAV

        if group is not self._group or place < self._done - 1:
            self._group, self._done = group, 0
            self._decoder = FrameDecoder()
        for data in group[self._done : place + 1]:
            pictures = self._decoder.decode(Packet(data))
            self._picture = pictures[-1] if pictures else None
            self._done += 1
        if self._picture is None:
            return None
        return np.asarray(self._picture.to_ndarray(format="bgr24"), np.uint8)
