"""Video that may arrive damaged: frames from packets, and pictures that nothing is missing from."""

from __future__ import annotations

import re
from dataclasses import dataclass

import av
import cv2
import numpy as np
from av.codec.context import Flags
from av.error import FFmpegError
from av.packet import Packet
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame
from numpy.typing import NDArray

__all__ = ["FrameAssembler", "FrameDecoder", "WholeFrame", "bgr_image"]

_LONGEST = 1460
"""Size in bytes of a Tello's video packet: a shorter one ends a frame. Waiting for the next frame's
start code instead, as FFmpeg's own parser must, would add a frame interval of latency."""
_START_CODE = b"\x00\x00\x00\x01"
_UNIT = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)
_SLICES = frozenset({1, 2, 5})
_KEY_SLICE, _SEQUENCE_PARAMETERS, _PICTURE_PARAMETERS = 5, 7, 8
"""Types of NAL units (ITU-T H.264, table 7-1)."""
_HEADER = 96
"""Bytes of a unit that hold all that is read of it, scaling lists included."""
_WITH_CHROMA = frozenset({44, 83, 86, 100, 110, 118, 122, 128, 134, 135, 138, 139, 244})
"""Profiles whose parameters tell the format of colours (7.3.2.1.1)."""
_NO_SUBSAMPLING = 3
_MOST_SEQUENCE_IDS, _MOST_PICTURE_IDS, _MOST_NUMBER_BITS = 31, 255, 16
"""Bounds of 7.4.2: a stream may claim any number."""
_BEGIN_WHOLE = ("h264", "hevc")
"""Decoders that hold pictures back until one is whole, by key frames or step by step."""
_LENGTHS_AHEAD = b"\1"
"""First byte of the headers of H.264 whose units have their lengths ahead (ISO/IEC 14496-15)."""
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

    def add_packet(self, packet: bytes, now: int) -> list[WholeFrame]:
        """Add a packet.

        Args:
            packet: Its content, a part of a frame's byte stream.
            now: Host time at which it was received, nanoseconds.

        Returns:
            The frames that it completes.
        """
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


class _Bits:
    """Numbers of a NAL unit's header, bit by bit; raises IndexError behind its end."""

    def __init__(self, unit: bytes) -> None:
        content = unit.replace(b"\0\0\3", b"\0\0")
        self._bits = f"{int.from_bytes(content, 'big'):0{8 * len(content)}b}"
        self._place = 0

    def fixed(self, count: int) -> int:
        """A number of `count` bits, u(n)."""
        begin, self._place = self._place, self._place + count
        if self._place > len(self._bits):
            raise IndexError
        return int(self._bits[begin : self._place] or "0", 2)

    def unsigned(self, most: int | None = None) -> int:
        """A number of a length of its own, ue(v); raises ValueError for one above `most`."""
        zeros = self._bits.index("1", self._place) - self._place
        self.fixed(zeros)
        value = self.fixed(zeros + 1) - 1
        if most is not None and value > most:
            raise ValueError
        return value

    def signed(self) -> int:
        """As `unsigned`, with a sign: se(v)."""
        value = self.unsigned()
        return (value + 1) // 2 if value % 2 else -(value // 2)


@dataclass(frozen=True)
class _Sequence:
    """Frame numbering of an H.264 sequence, by its parameters."""

    number_bits: int
    has_planes: bool
    has_gaps: bool
    """Whether frames may be left out on purpose."""
    has_fields: bool
    """Whether two fields of one number may make a frame."""


class _FrameNumbers:
    """Follows H.264's frame numbers, which tell that a frame is lost (7.4.3, 8.2.5.2).

    FFmpeg shows the frame before in the place of one that is lost, and marks nothing.
    """

    def __init__(self) -> None:
        self._sequences: dict[int, _Sequence] = {}
        self._pictures: dict[int, int] = {}
        """Sequence parameters by those of pictures."""
        self._last: int | None = None
        """Number of the last frame that others may rest on."""
        self._time: int | None = None
        self._interval = 0.0
        """Usual time between frames."""

    def forget(self) -> None:
        """Let any frame follow."""
        self._last = None

    def is_gap_before(self, data: bytes, time: int | None = None) -> bool:
        """Whether a frame is missing between the last and this one.

        Args:
            data: The frame in Annex B format.
            time: When it is due, in the stream's own units; None if that is not known.
        """
        pause = self._intervals_to(time)
        for match in _UNIT.finditer(data):
            kind, bits = match[1][0] & 0x1F, _Bits(data[match.end() : match.end() + _HEADER])
            try:
                if kind == _SEQUENCE_PARAMETERS:
                    self._read_sequence(bits)
                elif kind == _PICTURE_PARAMETERS:
                    self._pictures[bits.unsigned(_MOST_PICTURE_IDS)] = bits.unsigned()
                elif kind in _SLICES:
                    kept = match[1][0] >> 5 > 0
                    return self._is_gap_at(bits, pause, is_key=kind == _KEY_SLICE, kept=kept)
            except (IndexError, ValueError):
                # The decoder tells what is wrong with a header that ends early.
                continue
        return False

    def _intervals_to(self, time: int | None) -> float:
        """Take a frame's time; returns how many usual intervals it lies behind the last one's."""
        before, self._time = self._time, time
        if time is None or before is None or time <= before:
            return 0.0
        step = float(time - before)
        usual = self._interval or step
        # The pause of a loss hardly changes what is usual.
        self._interval = usual + (min(step, 2.0 * usual) - usual) / 8.0
        return step / usual

    def _is_gap_at(self, bits: _Bits, pause: float, *, is_key: bool, kept: bool) -> bool:
        """Take a slice's header, `pause` intervals behind the last; others rest on a `kept` one."""
        is_part = bits.unsigned() > 0
        bits.unsigned()
        sequence = self._sequences.get(self._pictures.get(bits.unsigned(), -1))
        if sequence is None:
            return False
        if sequence.has_planes:
            bits.fixed(2)
        count = 1 << sequence.number_bits
        number, last = bits.fixed(sequence.number_bits), self._last
        if kept or last is None:
            self._last = number
        if is_key or last is None or sequence.has_gaps:
            return False
        step = (number - last) % count
        repeats = step == 0 and not is_part and not sequence.has_fields
        # In a pause that long the numbers may have begun again.
        return step > 1 or repeats or pause > count - 0.5

    def _read_sequence(self, bits: _Bits) -> None:
        profile = bits.fixed(8)
        bits.fixed(16)
        name, chroma, has_planes = bits.unsigned(_MOST_SEQUENCE_IDS), 1, False
        if profile in _WITH_CHROMA:
            chroma = bits.unsigned()
            has_planes = chroma == _NO_SUBSAMPLING and bool(bits.fixed(1))
            bits.unsigned()
            bits.unsigned()
            bits.fixed(1)
            if bits.fixed(1):
                for index in range(12 if chroma == _NO_SUBSAMPLING else 8):
                    if bits.fixed(1):
                        _skip_scaling_list(bits, 16 if index < 6 else 64)  # noqa: PLR2004
        number_bits = bits.unsigned(_MOST_NUMBER_BITS - 4) + 4
        order = bits.unsigned()
        if order == 0:
            bits.unsigned()
        elif order == 1:
            bits.fixed(1)
            for _ in range(2):
                bits.signed()
            for _ in range(bits.unsigned()):
                bits.signed()
        bits.unsigned()
        has_gaps = bool(bits.fixed(1))
        bits.unsigned()
        bits.unsigned()
        has_fields = not bits.fixed(1)
        self._sequences[name] = _Sequence(number_bits, has_planes, has_gaps, has_fields)


def _skip_scaling_list(bits: _Bits, size: int) -> None:
    last = following = 8
    for _ in range(size):
        if following:
            following = (last + bits.signed()) % 256
        last = following or last


class FrameDecoder:
    """Decodes to pictures that are whole, from the first key frame on.

    A damaged frame, and all that follow it or a lost one up to the next key frame, are left out:
    they look smeared.
    """

    def __init__(
        self,
        codec: VideoCodecContext | None = None,
        *,
        only_whole: bool = True,
        most_pixels: int = _MOST_PIXELS,
    ) -> None:
        """Decode by `codec`, or H.264 in Annex B format.

        Without `only_whole`, pictures that rest on a damaged or lost one come, too. A stream of
        pictures with more than `most_pixels` is not decoded.
        """
        self._only_whole = only_whole
        if codec is None:
            codec = av.CodecContext.create("h264", "r")
            # Frame threading would delay frames, as does reordering for B frames.
            codec.thread_count = 1
            codec.flags |= Flags.low_delay
        codec.options = {**codec.options, "max_pixels": str(most_pixels)}
        self._codec = codec
        headers = codec.extradata or b""
        self._numbers = None
        if codec.name == "h264" and headers[:1] != _LENGTHS_AHEAD:
            self._numbers = _FrameNumbers()
            self._numbers.is_gap_before(headers)
        self._started = False
        self._tainted = True
        self.broken = 0
        """Number of frames that could not be decoded, or only with damage."""
        self.waiting = 0
        """Number of frames omitted before a key frame: the first, or with `only_whole` the next."""

    def decode(self, packet: Packet) -> list[VideoFrame]:
        """Decode one frame's packet; returns the whole pictures that it completes."""
        time = packet.pts if packet.dts is None else packet.dts
        numbers = self._numbers
        if packet.is_corrupt or (numbers and numbers.is_gap_before(bytes(packet), time)):
            self._taint()
        try:
            pictures = self._codec.decode(packet)
        except FFmpegError:
            if self._started:
                self.broken += 1
            else:
                self.waiting += 1
            self._taint()
            return []
        self._started = self._started or bool(pictures)
        if not pictures and (self._tainted or self._codec.flags & Flags.low_delay):
            self.waiting += 1
        return [picture for picture in pictures if self._is_whole(picture)]

    def _is_whole(self, picture: VideoFrame) -> bool:
        if picture.is_corrupt:
            self.broken += 1
            self._taint()
            return False
        if picture.key_frame or self._codec.name in _BEGIN_WHOLE:
            self._tainted = False
        if self._tainted and self._only_whole:
            self.waiting += 1
            return False
        return True

    def _taint(self) -> None:
        """Show nothing before the next key frame."""
        self._tainted = True
        if not self._only_whole:
            return
        # The decoder then begins anew: it knows best from which frame on pictures are whole, where
        # key frames are no more than a point from which on they are refreshed.
        if self._codec.is_open:
            self._codec.flush_buffers()
        if self._numbers is not None:
            self._numbers.forget()


def bgr_image(frame: VideoFrame) -> NDArray[np.uint8]:
    """Height x width x 3; OpenCV converts the usual format three times as fast as FFmpeg."""
    planar, even = "yuv420p", not (frame.width % 2 or frame.height % 2)
    if frame.format.name == planar and even:
        return np.asarray(cv2.cvtColor(frame.to_ndarray(), cv2.COLOR_YUV2BGR_I420), np.uint8)
    return np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)
