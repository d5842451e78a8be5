"""H.264 in pieces of UDP: frames put together, then decoded without a frame's delay."""

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
"""Bytes of a Tello's video packet: a shorter one ends a frame. Waiting for the next frame's start
code instead, as FFmpeg's own parser must, would cost a frame's time."""
_START_CODE = b"\x00\x00\x00\x01"
_UNIT = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)
_SLICES = frozenset({1, 2, 5})
_LARGEST_FRAME = 1 << 20
"""Bytes from which on something that claims to be a frame is none."""


@dataclass(frozen=True, slots=True)
class WholeFrame:
    """The bytes of one encoded frame, with the headers before it."""

    content: bytes
    arrived: int
    """When its first packet came, host nanoseconds."""


class FrameAssembler:
    """Puts packets together to frames; what is lost in between is the decoder's to notice."""

    def __init__(self) -> None:
        """Wait for the start of a frame."""
        self._content = bytearray()
        self._arrived = 0
        self._has_slice = False
        self.dropped = 0
        """Packets that belong to no frame: the stream was joined in its middle, or is none."""

    def take(self, packet: bytes, now: int) -> list[WholeFrame]:
        """Take a packet that came at `now` (host nanoseconds); returns the frames it completes."""
        done: list[WholeFrame] = []
        starts = packet.startswith(_START_CODE)
        if starts and self._has_slice:
            # The frame before had no short packet: it was lost, or the sizes came out even.
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
    """One frame in, one picture out, from the first key frame on."""

    def __init__(self, *, only_whole: bool = False) -> None:
        """With `only_whole`, leave out what rests on a damaged frame."""
        self._only_whole = only_whole
        self._codec = self._fresh()
        self._started = False
        self._tainted = True
        self.broken = 0
        """Frames that could not be decoded, or only with damage."""
        self.waiting = 0
        """Frames left out before the first key frame, or with `only_whole` before the next one."""

    @staticmethod
    def _fresh() -> VideoCodecContext:
        codec = av.CodecContext.create("h264", "r")
        # Threads by frame would hold frames back, as does reordering for B frames.
        codec.thread_count = 1
        codec.flags |= Flags.low_delay
        return codec

    def decode(self, frame: WholeFrame) -> VideoFrame | None:
        """Decode `frame`; None if no picture that is fit to be shown comes of it."""
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
