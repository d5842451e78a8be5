"""Cloud executor: runs analyses on frames, several at once.

A frame is sent in the first call for it; subsequent calls refer to it.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from dataclasses import replace
from typing import Any, NamedTuple

import ray

from aerodaas.actors.cluster.dead_man import exit_actor
from aerodaas.actors.priority import be_nice
from aerodaas.actors.process_variables import ProcessVariables
from aerodaas.actors.run.application import Application
from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.clock import host_time_ns
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.runtime.dispatch.frame_codec import CodedFrame, decoded, load

__all__ = ["FRAMES_KEPT", "CloudExecutor", "Executed", "MissingFrameError", "UnpreparedError"]

_NICENESS = 10
"""Niceness of its process: on a shared machine, the drone's actor has precedence."""
FRAMES_KEPT = 8
"""Frames kept for references; the oldest is replaced by the next."""
_UNPACKING = 2.0
"""Seconds to wait for another call's thread to unpack its frame."""


class UnpreparedError(AeroDaaSError):
    """A call to an executor without analyses, because Ray has restarted it."""


class MissingFrameError(AeroDaaSError):
    """A call that refers to a frame that the executor does not have."""


class Executed(NamedTuple):
    """Result of an execution."""

    message: bytes
    """The encoded message with the result; its last span is the time on the executor."""
    decoding: float
    """Seconds of it spent on decompressing the frame; 0 if the call referred to the frame."""


class CloudExecutor:
    """Actor that executes the analyses of `prepare`; Ray limits the concurrent `execute`."""

    def __init__(self, application: Application | None = None) -> None:
        """Create it without analyses, which Ray would store for restarts.

        Unpickling `application` makes its definitions available, also after a restart.
        """
        del application
        self._analyses: dict[str, Analytics[Any]] = {}
        self._turns: dict[str, threading.Lock] = {}
        self._frames: OrderedDict[tuple[str, int], Message[Any]] = OrderedDict()
        self._unpacked = threading.Condition()

    def prepare(self, variables: ProcessVariables, analyses: dict[str, Analytics[Any]]) -> None:
        """Open the analyses.

        Args:
            variables: Set in this process by their arrival.
            analyses: The analyses, by stream.
        """
        del variables
        if ray.is_initialized() and ray.get_runtime_context().get_actor_id():
            be_nice(_NICENESS)
        load()
        for analysis in analyses.values():
            analysis.open()
        self._turns = {name: threading.Lock() for name, a in analyses.items() if not a.concurrent}
        self._analyses = analyses

    def ready(self) -> bool:
        """Whether it is prepared; False after a restart by Ray."""
        return bool(self._analyses)

    def resolve_address(self) -> None:
        """Do nothing: the call makes Ray resolve the actor's address for the caller."""

    def exit(self) -> None:
        """End the process."""
        exit_actor()

    def ping(self, data: bytes) -> int:
        """Answer at once, to measure the link; returns the number of bytes."""
        return len(data)

    def execute(
        self, analysis: str, frame: tuple[str, int], data: bytes, budget: float | None = None
    ) -> Executed:
        """Analyse a frame.

        Args:
            analysis: Stream of the analysis.
            frame: Stream and number of the frame's message.
            data: The encoded message; empty if an earlier call carried it.
            budget: Seconds left, for analyses that adapt to it; None for no limit.

        Raises:
            MissingFrameError: If no earlier call carried the message.
            UnpreparedError: If the executor was restarted.
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
        """The message with its image decompressed, and the seconds of decompression."""
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
        # The call that carries it came first, but another thread may still be unpacking it.
        with self._unpacked:
            if not self._unpacked.wait_for(lambda: frame in self._frames, _UNPACKING):
                raise MissingFrameError("the executor in the cloud lacks the frame")
            return self._frames[frame]


class _Context:
    """Context of an analysis in the cloud: time and time left; no vehicle and no alerts."""

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
