"""Uplink of frames to one node: each frame is sent once, encoded, and timed."""

from __future__ import annotations

import os
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from aerodaas.actors.streams import encode_message
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.runtime.dispatch.costs import LinkEstimate, Uplink
from aerodaas.runtime.dispatch.frame_codec import Codec, load

__all__ = ["FrameTransfer", "FrameUplink"]

_KEPT = 8
_PING_EVERY = 2.0
"""Seconds between two pings of the link."""
_LARGE_EVERY = 5.0
"""Seconds without a frame after which a ping carries `_LARGE` bytes, to measure the bandwidth."""
_LARGE = 65536
_PATIENCE = 60.0
"""Seconds after which a ping is considered lost."""


@dataclass
class FrameTransfer:
    """An encoded frame for a node."""

    name: tuple[str, int]
    """Stream and number of the message."""
    data: bytes
    """The encoded message."""
    original: int
    """Bytes before encoding."""
    expected: float
    """Expected seconds of encoding, transfer and decoding."""


class FrameUplink:
    """Link to one node: estimates, encoding of frames, and pings, in a packing thread."""

    def __init__(self, codec: Codec) -> None:
        """Create the uplink of frames in `codec`."""
        load()
        self.codec = codec
        self.link = LinkEstimate()
        self.uplink = Uplink(self.link)
        self.frames = 0
        """Frames encoded."""
        self.bytes = 0
        """Bytes of frames sent."""
        self._transfers: OrderedDict[tuple[str, int], FrameTransfer] = OrderedDict()
        self._packer = ThreadPoolExecutor(1, "packer")
        self._encoding = self._decoding = self._size = 0.0
        """Seconds of encoding and decoding, and bytes, of the newest transfer."""
        self._announced: dict[tuple[str, int], None] = {}
        """Messages that wait to be packed."""
        self._pinged = self._transferred = float("-inf")
        self._pinging: Future[Any] | None = None

    def later(self, work: Callable[[], None]) -> None:
        """Queue `work` for the packing thread."""
        self._packer.submit(work)

    def announce(self, message: Message[Any]) -> None:
        """Count a message that will be packed as queued on the link."""
        name = (message.stream, message.seq)
        if name not in self._transfers:
            self._announced[name] = None

    def pack(self, message: Message[Any]) -> FrameTransfer:
        """Transfer of a message, created at the first call. In the packing thread only."""
        key = (message.stream, message.seq)
        self._announced.pop(key, None)
        transfer = self._transfers.get(key)
        if transfer is None:
            transfer = self._transfers[key] = self._pack(message)
            while len(self._transfers) > _KEPT:
                self._transfers.popitem(last=False)
        return transfer

    def arrived(self, way: tuple[str, int], at: float, decoding: float) -> None:
        """Update the estimates from the call that carried a frame.

        Args:
            way: Name of the transfer on the uplink.
            at: When it was answered, less the execution, seconds.
            decoding: Time of decoding, seconds.
        """
        self._transferred = time.monotonic()
        self.uplink.arrive(way, at)
        self._decoding = decoding

    @property
    def expected(self) -> float:
        """Expected seconds of encoding, transfer and decoding for a frame like the last one.

        Current transfers and messages that wait to be packed precede it.
        """
        size = self._size * (1 + len(self._announced))
        return max(self._coding + self.uplink.seconds(size), self.link.latency)

    @property
    def _coding(self) -> float:
        return self._encoding + self._decoding

    def ping(self, executor: Any) -> None:  # noqa: ANN401 - a Ray handle
        """Measure the link with a ping, if one is due."""
        now = time.monotonic()
        answered = self._pinging is None or self._pinging.done()
        if now - self._pinged < (_PING_EVERY if answered else _PATIENCE):
            return
        self._pinged = now
        large = now - self._transferred >= _LARGE_EVERY and self.link.latency > 0
        if large:
            self._transferred = now
        self.later(lambda: self._ping(executor, _LARGE if large else 0))

    def look_again(self) -> None:
        """Make the next ping due now and large: the link may have changed."""
        self._pinged = self._transferred = float("-inf")

    def close(self) -> None:
        """Stop packing."""
        self._packer.shutdown(wait=False, cancel_futures=True)

    def _ping(self, executor: Any, size: int) -> None:  # noqa: ANN401
        # Random, so that no link compresses it.
        data = os.urandom(size)
        began = time.perf_counter()
        pinging: Future[int] = executor.ping.remote(data).future()
        self._pinging = pinging

        def answered(future: Future[int]) -> None:
            if future.exception() is None:
                if size:
                    # The link was idle, so this sample is better than all earlier ones.
                    self.link.forget()
                self.link.observe(size, time.perf_counter() - began)

        pinging.add_done_callback(answered)

    def _pack(self, message: Message[Any]) -> FrameTransfer:
        frame = message.item
        if isinstance(frame, Frame):
            began = time.perf_counter()
            message = _with_item(message, self.codec.encoded(frame))
            self._encoding = time.perf_counter() - began
        data = encode_message(message)
        self._size = len(data)
        self.frames += 1
        name = (message.stream, message.seq)
        original = frame.nbytes if isinstance(frame, Frame) else len(data)
        return FrameTransfer(name, data, original, self._coding + self.uplink.seconds(self._size))


def _with_item(message: Message[Any], item: Any) -> Message[Any]:  # noqa: ANN401
    fields = (message.stream, message.seq, message.stamp, message.header, message.captured)
    return Message(*fields, message.spans, item)
