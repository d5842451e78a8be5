"""Uplink of frames to one node: each frame is sent once, in the fastest coding, and timed."""

from __future__ import annotations

import os
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from aerodaas.actors.dispatch.costs import LinkEstimate, Uplink
from aerodaas.actors.dispatch.frame_codec import CODINGS, Coder, Coding, fastest
from aerodaas.actors.streams import encode_message
from aerodaas.types.data import Frame
from aerodaas.types.status import Message

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
    frame: Frame | None
    coding: Coding
    original: int
    """Bytes before coding."""
    expected: float
    """Expected seconds of coding and transfer."""


class FrameUplink:
    """Link to one node: estimates, coding of frames, and pings, in a packing thread."""

    def __init__(self, compression: str) -> None:
        """Create the uplink; `compression` is that of `ComputeConfig`."""
        self.link = LinkEstimate()
        self.uplink = Uplink(self.link)
        self.chosen: dict[str, int] = {}
        """Frames coded, by coding."""
        self.bytes = 0
        """Bytes of frames sent."""
        self._allowed = CODINGS[compression]
        self._coder = Coder()
        self._transfers: OrderedDict[tuple[str, int], FrameTransfer] = OrderedDict()
        self._packer = ThreadPoolExecutor(1, "packer")
        self._coding_seconds = self._size = 0.0
        """Coding time and size of the newest transfer."""
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

    def arrived(
        self, transfer: FrameTransfer, way: tuple[str, int], at: float, decoding: float
    ) -> None:
        """Update the estimates from the call that carried a frame.

        `at` is the time of its answer less the execution, `way` its name on the uplink,
        `decoding` the seconds of decompression.
        """
        self._transferred = time.monotonic()
        self.uplink.arrive(way, at)
        if transfer.frame is not None and decoding > 0:
            self._coder.took_to_decode(transfer.frame, transfer.coding, decoding)
        transfer.frame = None

    @property
    def expected(self) -> float:
        """Expected seconds of coding and transfer for a frame like the last one.

        Current transfers and messages that wait to be packed precede it.
        """
        size = self._size * (1 + len(self._announced))
        return max(self._coding_seconds + self.uplink.seconds(size), self.link.latency)

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
        frame = message.item if isinstance(message.item, Frame) else None
        coding: Coding = "raw"
        original = 0
        if frame is not None:
            original = frame.nbytes
            costs = self._coder.costs(frame, self._allowed)
            coding, _ = fastest(costs, self.link.seconds)
            self._coding_seconds = costs[coding].seconds
            if coding != "raw":
                message = _with_item(message, self._coder.encode(frame, coding))
        data = encode_message(message)
        self._size = len(data)
        self.chosen[coding] = self.chosen.get(coding, 0) + 1
        name = (message.stream, message.seq)
        expected = self._coding_seconds + self.uplink.seconds(self._size)
        return FrameTransfer(name, data, frame, coding, original or len(data), expected)


def _with_item(message: Message[Any], item: Any) -> Message[Any]:  # noqa: ANN401
    fields = (message.stream, message.seq, message.stamp, message.header, message.captured)
    return Message(*fields, message.spans, item)
