"""H.264 over UDP: assembly of frames from packets, and decoding without a frame of delay."""

from __future__ import annotations

import re
from dataclasses import dataclass

import av
from av.codec.context import Flags
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame

__all__ = ["FrameAssembler", "FrameDecoder", "WholeFrame"]

_LONGEST = 1460
"""Size in bytes of a Tello's video packet: a shorter one ends a frame. Waiting for the next frame's
start code instead, as FFmpeg's own parser must, would add a frame interval of latency."""
_START_CODE = b"\x00\x00\x00\x01"
_UNIT = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)
_SLICES = frozenset({1, 2, 5})
_MOST_PIXELS = 1 << 25
"""Pixels of the largest picture that is decoded: 8K has 33.2 million. A stream may claim any size,
and FFmpeg allocates several pictures of it before the first is decoded."""
_LARGEST_FRAME = 1 << 20
"""Size in bytes above which the content is discarded as invalid."""


@dataclass(frozen=True, slots=True)
class WholeFrame:
    """One encoded frame with the headers before it."""

    content: bytes
    arrived: int
    """Host time of its first packet's arrival, nanoseconds."""


class FrameAssembler:
    """Assembles packets to frames; the decoder detects frames with lost packets."""

    def __init__(self) -> None:
        """Start without packets, waiting for a start code."""
        self._content = bytearray()
        self._arrived = 0
        self._has_slice = False
        self.dropped = 0
        """Number of packets outside a frame: from before the first start code, or invalid."""

    def take(self, packet: bytes, now: int) -> list[WholeFrame]:
        """Add a packet received at `now` (host nanoseconds); returns the frames it completes."""
        done: list[WholeFrame] = []
        starts = packet.startswith(_START_CODE)
        if starts and self._has_slice:
            # The previous frame had no short packet: it was lost, or the last one was full.
            done.append(self._finish())
        if not starts and not self._content:
            self.dropped += 1
            return done
        if not self._content:
            self._arrived = now
        self._content += packet
        if starts and not self._has_slice:
            kinds = {match[1][0] & 0x1F for match in _UNIT.finditer(packet)}
            self._has_slice = bool(kinds & _SLICES)
        if self._has_slice and len(packet) < _LONGEST:
            done.append(self._finish())
        elif len(self._content) > _LARGEST_FRAME:
            self._finish()
            self.dropped += 1
        return done

    def _finish(self) -> WholeFrame:
        frame = WholeFrame(bytes(self._content), self._arrived)
        self._content.clear()
        self._has_slice = False
        return frame


class FrameDecoder:
    """Decodes one image per frame, from the first key frame on."""

    def __init__(self, *, only_whole: bool = False, most_pixels: int = _MOST_PIXELS) -> None:
        """With `only_whole`, omit images that depend on a damaged frame.

        A stream of pictures with more than `most_pixels` is not decoded.
        """
        self._only_whole = only_whole
        self._most_pixels = most_pixels
        self._codec = self._fresh()
        self._started = False
        self._tainted = True
        self.broken = 0
        """Number of frames that could not be decoded, or only with damage."""
        self.waiting = 0
        """Number of frames omitted before a key frame: the first, or with `only_whole` the next."""

    def _fresh(self) -> VideoCodecContext:
        codec = av.CodecContext.create("h264", "r")
        # Frame threading would delay frames, as does reordering for B frames.
        codec.thread_count = 1
        codec.flags |= Flags.low_delay
        codec.options = {"max_pixels": str(self._most_pixels)}
        return codec

    def decode(self, frame: WholeFrame) -> VideoFrame | None:
        """Decode `frame`; None without an intact image."""
        try:
            pictures = self._codec.decode(av.Packet(frame.content))
        except FFmpegError:
            pictures = []
        if not pictures:
            if self._started:
                self.broken += 1
                self._tainted = True
            else:
                self.waiting += 1
            return None
        self._started = True
        picture = pictures[-1]
        return picture if self._is_fit(picture) else None

    def _is_fit(self, picture: VideoFrame) -> bool:
        if picture.is_corrupt:
            self.broken += 1
            self._tainted = True
            return False
        if picture.key_frame:
            self._tainted = False
        if self._tainted and self._only_whole:
            self.waiting += 1
            return False
        return True
