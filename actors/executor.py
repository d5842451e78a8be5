"""The cloud's executor: runs analyses on frames that come as references, several at once."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from typing import Any, NamedTuple

from aerodaas.actors._coding import CodedFrame, decoded
from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.clock import host_time_ns
from aerodaas.data import Alert
from aerodaas.errors import AeroDaaSError
from aerodaas.status import Hop, Message
from aerodaas.vehicle import VehicleState

__all__ = ["CloudExecutor", "Executed", "UnpreparedError"]

_FRAMES_KEPT = 4


class UnpreparedError(AeroDaaSError):
    """An executor that Ray has restarted holds no analyses yet."""


class Executed(NamedTuple):
    """What an execution gives back."""

    message: bytes
    """The message, encoded, with the result in it; its last hop tells how long it was here."""
    decoding: float
    """Seconds of it that went into decompressing the frame; 0 where another analysis had."""


class CloudExecutor:
    """Holds the analyses of `prepare`; Ray runs as many `execute` at once as it was told."""

    def __init__(self) -> None:
        """Hold nothing yet: the analyses would be kept for restarts."""
        self._analyses: dict[str, Analytics[Any]] = {}
        self._turns: dict[str, threading.Lock] = {}
        self._frames: OrderedDict[tuple[str, int], Any] = OrderedDict()
        self._decoding = threading.Lock()

    def prepare(self, analyses: dict[str, Analytics[Any]]) -> None:
        """Open the analyses, by stream."""
        for analysis in analyses.values():
            analysis.open()
        self._turns = {name: threading.Lock() for name, a in analyses.items() if not a.concurrent}
        self._analyses = analyses

    def ready(self) -> bool:
        """Whether it is prepared; one that Ray has restarted is not."""
        return bool(self._analyses)

    def ping(self, data: bytes) -> int:
        """Answer at once, to measure the way here; returns the number of bytes."""
        return len(data)

    def execute(self, stream: str, data: bytes, budget: float | None = None) -> Executed:
        """Analyse the item of an encoded message within `budget` seconds, if it can hurry."""
        if not self._analyses:
            raise UnpreparedError("the executor in the cloud was restarted")
        received = host_time_ns()
        message = decode_message(memoryview(data))
        item, decoding = self._decoded(message)
        context = _Context(message.header.stamp, budget)
        work, turn = self._analyses[stream], self._turns.get(stream)
        if turn is None:
            result = work.process(item, context)
        else:
            with turn:
                result = work.process(item, context)
        fields = (message.stream, message.seq, message.stamp, message.header, message.captured)
        hops = (*message.hops, Hop(stream, received, host_time_ns()))
        return Executed(encode_message(Message(*fields, hops, result)), decoding)

    def _decoded(self, message: Message[Any]) -> tuple[Any, float]:
        """The item, decompressed once for all analyses here, and the seconds that it took."""
        if not isinstance(message.item, CodedFrame):
            return message.item, 0.0
        key = (message.stream, message.seq)
        with self._decoding:
            if key in self._frames:
                return self._frames[key], 0.0
            began = time.perf_counter()
            self._frames[key] = decoded(message.item)
            while len(self._frames) > _FRAMES_KEPT:
                self._frames.popitem(last=False)
            return self._frames[key], time.perf_counter() - began


class _Context:
    """What an analysis may ask of the cloud: the time of its item, and nobody to alert."""

    kind: ComputeKind = "cloud"

    def __init__(self, stamp: int, budget: float | None) -> None:
        self._stamp = stamp
        self._until = None if budget is None else time.monotonic() + budget

    def now(self) -> int:
        return self._stamp

    def time_left(self) -> float | None:
        return None if self._until is None else self._until - time.monotonic()

    def vehicle(self) -> VehicleState | None:
        return None

    def alert(self, alert: Alert) -> None:
        raise NotImplementedError(f"an analysis in the cloud cannot alert: {alert.text}")
