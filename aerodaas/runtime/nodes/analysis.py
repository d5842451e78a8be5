"""Analysis node: runs one analysis on the items of its streams, or as a source of its own."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.clock import Clock, host_time_ns
from aerodaas.errors import failure_line
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.runtime.dispatch.recent_frames import FrameReference, MissingFrame, RecentFrames
from aerodaas.runtime.node import NEVER, Host, Node
from aerodaas.runtime.nodes.triggers import TriggerSpec, fire
from aerodaas.runtime.session import FRAME_DEPTH, Session

__all__ = ["AnalysisNode", "AnalysisSpec", "Wake"]

_WAKE_DEPTH = 8


@dataclass(frozen=True)
class Wake:
    """Command to a dormant analysis to process items from now on."""


@dataclass(frozen=True)
class AnalysisSpec:
    """Specification of one analysis for its node."""

    stream: str
    work: Analytics[Any]
    inputs: dict[str, int]
    """Input streams and their queue depths."""
    robot: str
    """Robot that its data belongs to."""
    state: str
    """Stream of the vehicle states of that robot."""
    external: bool
    dormant: bool
    triggers: tuple[TriggerSpec, ...]
    kind: ComputeKind
    """Kind of compute node on which it runs."""
    answers_always: bool
    """Whether a dispatcher waits for an answer to each item."""
    wakes: tuple[str, ...]
    """Streams of the wake commands for a dormant analysis."""
    frames: tuple[str, ...] = ()
    """Streams of the frames that its tasks refer to."""
    niceness: int = 10
    """Of its process."""

    def make(self, session: Session) -> AnalysisNode:
        """Make the node."""
        return AnalysisNode(session, self)


class AnalysisNode(Node):
    """One analysis: processes items, publishes results; serves as the analysis' `Context`."""

    def __init__(self, session: Session, spec: AnalysisSpec) -> None:
        """Create the node of the analysis `spec` in the run `session`."""
        # States come last: each is published before the measurements made in it, so that the
        # state of a received item is available, too.
        reads = {
            **dict.fromkeys(spec.frames, FRAME_DEPTH),
            **spec.inputs,
            **dict.fromkeys(spec.wakes, _WAKE_DEPTH),
            spec.state: 1,
        }
        super().__init__(spec.stream, reads)
        self.spec = spec
        self.busy = 0.0
        """Host seconds of processing so far."""
        self.errors = 0
        self.last_error = ""
        self.processing_since: float | None = None
        """Host time (`perf_counter`) at which the item in process was begun; None between two."""
        self._session = session
        self._opened = False
        self._results = self.outlet(spec.stream)
        for trigger in spec.triggers:
            self.outlet(trigger.stream)
        self._woken: int | None = None if spec.dormant else -1
        """Timestamp of the measurement that woke it; None while dormant."""
        self._vehicle: VehicleState | None = None
        self._now = 0
        self._due = NEVER
        self._frames = RecentFrames(spec.frames)
        self._out: list[Message[Any]] = []

    def open(self, host: Host) -> None:
        """Open the analysis; raises the exceptions of its `open`."""
        super().open(host)
        self.spec.work.open()
        self._opened = True

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Begin: an external source knows when it measures first."""
        if self.spec.external:
            self._due = self._next_due(clock.now() - 1)
        return ()

    @property
    def due(self) -> int:
        """Mission time of an external source's next measurement."""
        return self._due

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Process the items of `inputs`, or measure if that is due.

        Args:
            now: Mission clock, nanoseconds.
            inputs: New messages, each stream's in order.
        """
        for message in inputs:
            self._receive(message)
        for message in inputs:
            if message.stream in self.spec.inputs:
                self._process_input(message)
        if now >= self._due:
            self._due = self._next_due(now)
            self._measure(now)
        published, self._out = self._out, []
        return published

    def _next_due(self, after: int) -> int:
        return self._session.next_due(self.spec.stream, self.spec.work.rate, after)

    def _receive(self, message: Message[Any]) -> None:
        self._frames.add(message)
        if message.stream == self.spec.state:
            self._vehicle = message.item or self._vehicle
        elif isinstance(message.item, Wake):
            stamp = message.header.stamp
            self._woken = stamp if self._woken is None else min(self._woken, stamp)

    def _process_input(self, message: Message[Any]) -> None:
        if isinstance(message.item, FrameReference):
            frame = self._frames.find(message.item)
            if frame is None:
                missing = MissingFrame(message.item)
                self._out.append(
                    self._results.derive(missing, message, host_time_ns(), self.host.now())
                )
                return
            message = replace(message, item=frame.item)
        received = host_time_ns()
        awake = self._is_awake(message.header.stamp)
        result = None
        if message.item is not None and awake:
            result = self._process(message.item, message.header.stamp)
        if result is not None:
            self._fire(result, message)
        # An answer without a result records that this item was processed, and when.
        if awake or self.spec.answers_always:
            self._out.append(self._results.derive(result, message, received, self.host.now()))

    def _measure(self, stamp: int) -> None:
        header = Header(self._results.sent, stamp, self.spec.stream)
        captured = host_time_ns()
        if not self._is_awake(stamp):
            return
        item = self._process(None, stamp)
        if item is not None:
            origin = Message(self.spec.stream, header.id, stamp, header, captured, (), item)
            self._fire(item, origin)
        self._out.append(self._results.measure(item, header, captured))

    def _fire(self, result: Any, origin: Message[Any]) -> None:  # noqa: ANN401
        self._out += fire(self, self.spec.triggers, result, origin, self.host.now(), self._report)

    def _is_awake(self, stamp: int) -> bool:
        """Return whether a measurement at `stamp` is later than the wake command's."""
        return self._woken is not None and stamp > self._woken

    def _process(self, item: Any, now: int) -> Any:  # noqa: ANN401
        self._now = now
        began = self.processing_since = time.perf_counter()
        try:
            return self.spec.work.process(item, self)
        except Exception as error:  # noqa: BLE001 - a user's analysis may raise anything
            self._report(error)
            return None
        finally:
            self.processing_since = None
            self.busy += time.perf_counter() - began

    def _report(self, error: Exception) -> None:
        self.errors += 1
        line = f"{self.spec.stream}: {failure_line(error)}"
        if line != self.last_error:
            self.last_error = line
            self.host.alert("analysis_failed", line, self._now)

    def close(self) -> None:
        """Close the analysis."""
        if self._opened:
            self._opened = False
            try:
                self.spec.work.close()
            except Exception as error:  # noqa: BLE001 - a user's analysis may raise anything
                self._report(error)

    def values(self) -> dict[str, Any]:
        """Seconds of processing, and errors, by analysis."""
        name = self.spec.stream
        return {
            "busy_seconds": {name: self.busy},
            "errors": {name: self.errors} if self.errors else {},
            "last_errors": [self.last_error] if self.last_error else [],
        }

    @property
    def kind(self) -> ComputeKind:
        """Kind of compute node on which the analysis runs."""
        return self.spec.kind

    def now(self) -> int:
        """Mission time of the item in process, nanoseconds."""
        return self._now

    def vehicle(self) -> VehicleState | None:
        """The newest vehicle state; None before the first."""
        return self._vehicle

    def alert(self, alert: Alert) -> None:
        """Publish an alert."""
        self.host.alert(alert.kind, alert.text, alert.header.stamp, alert.values)
