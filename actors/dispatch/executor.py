"""The cloud's executor: runs analyses on frames, several at once.

A frame travels in the first call that is about it; the calls that follow name it.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from dataclasses import replace
from typing import Any, NamedTuple

import ray

from aerodaas.actors.cluster.dead_man import leave
from aerodaas.actors.dispatch.frame_codec import CodedFrame, decoded
from aerodaas.actors.priority import be_nice
from aerodaas.actors.run.application import Application
from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Alert
from aerodaas.types.errors import AeroDaaSError
from aerodaas.types.status import Message, TraceSpan
from aerodaas.types.vehicle import VehicleState

__all__ = ["FRAMES_KEPT", "CloudExecutor", "Executed", "MissingFrameError", "UnpreparedError"]

_NICENESS = 10
"""Niceness of its process, so that on one machine the setpoint loop comes first."""
FRAMES_KEPT = 8
"""Frames that can be named; the oldest gives way to the next."""
_UNPACKING = 2.0
"""Seconds that the thread with the call that carries a frame may take to unpack it."""


class UnpreparedError(AeroDaaSError):
    """An executor that Ray has restarted holds no analyses yet."""


class MissingFrameError(AeroDaaSError):
    """An executor does not hold the frame that a call names."""


class Executed(NamedTuple):
    """The answer of an execution."""

    message: bytes
    """The encoded message with the result; its last span is the executor's."""
    decoding: float
    """Seconds of it that went into decompressing the frame; 0 where the frame was named."""


class CloudExecutor:
    """Holds the analyses of `prepare`; Ray runs several `execute` at once, up to its slots."""

    def __init__(self, application: Application | None = None) -> None:
        """Hold nothing yet: the analyses would be kept for restarts.

        What the `application` defines is known from here on, and after a restart.
        """
        del application
        self._analyses: dict[str, Analytics[Any]] = {}
        self._turns: dict[str, threading.Lock] = {}
        self._frames: OrderedDict[tuple[str, int], Message[Any]] = OrderedDict()
        self._unpacked = threading.Condition()

    def prepare(self, analyses: dict[str, Analytics[Any]]) -> None:
        """Open the analyses, by stream."""
        if ray.is_initialized() and ray.get_runtime_context().get_actor_id():
            be_nice(_NICENESS)
        for analysis in analyses.values():
            analysis.open()
        self._turns = {name: threading.Lock() for name, a in analyses.items() if not a.concurrent}
        self._analyses = analyses

    def ready(self) -> bool:
        """Whether it is prepared; one that Ray has restarted is not."""
        return bool(self._analyses)

    def meet(self) -> None:
        """Let its caller learn where it lives."""

    def leave(self) -> None:
        """End the process."""
        leave()

    def ping(self, data: bytes) -> int:
        """Answer at once, to measure the link; returns the number of bytes."""
        return len(data)

    def execute(
        self, analysis: str, frame: tuple[str, int], data: bytes, budget: float | None = None
    ) -> Executed:
        """Analyse a frame within `budget` seconds, if the analysis can hurry.

        `frame` is the stream and number of its message; `data` the encoded message, or nothing
        where an earlier call carried it. Raises MissingFrameError if none did.
        """
        if not self._analyses:
            raise UnpreparedError("the executor in the cloud was restarted")
        received = host_time_ns()
        message, decoding = self._unpack(frame, data) if data else (self._named(frame), 0.0)
        context = _Context(message.header.stamp, budget)
        work, turn = self._analyses[analysis], self._turns.get(analysis)
        if turn is None:
            result = work.process(message.item, context)
        else:
            with turn:
                result = work.process(message.item, context)
        spans = (*message.spans, TraceSpan(analysis, received, host_time_ns()))
        return Executed(encode_message(replace(message, spans=spans, item=result)), decoding)

    def _unpack(self, frame: tuple[str, int], data: bytes) -> tuple[Message[Any], float]:
        """The message with its image decompressed, and the seconds of decompressing."""
        message, decoding = decode_message(memoryview(data)), 0.0
        if isinstance(message.item, CodedFrame):
            began = time.perf_counter()
            message = replace(message, item=decoded(message.item))
            decoding = time.perf_counter() - began
        with self._unpacked:
            self._frames[frame] = message
            while len(self._frames) > FRAMES_KEPT:
                self._frames.popitem(last=False)
            self._unpacked.notify_all()
        return message, decoding

    def _named(self, frame: tuple[str, int]) -> Message[Any]:
        # The call that carries it came first, but another thread may still be at it.
        with self._unpacked:
            if not self._unpacked.wait_for(lambda: frame in self._frames, _UNPACKING):
                raise MissingFrameError("the executor in the cloud lacks the frame")
            return self._frames[frame]


class _Context:
    """Context of an analysis in the cloud: the time of its item; it cannot alert."""

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
