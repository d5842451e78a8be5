"""Worker: the loop of one analysis in its actor, which receives, processes and publishes."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.actors.base import StreamActor
from aerodaas.actors.drone.mission_link import StreamLink
from aerodaas.actors.triggers import Triggers, TriggerSpec
from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.analytics.commanding import CommandingAnalytics
from aerodaas.runtime.dispatch.recent_frames import FrameReference, MissingFrame, RecentFrames
from aerodaas.runtime.session import FRAME_DEPTH, next_due
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Alert, Header
from aerodaas.types.errors import failure_line
from aerodaas.types.status import Message
from aerodaas.types.vehicle import VehicleState

__all__ = ["NodeSpec", "Wake", "Worker"]

_WAKE_DEPTH = 8
_HUNG = 5.0
"""Wall seconds on one item before an alert; a first inference may take several."""


@dataclass(frozen=True)
class Wake:
    """Command to a dormant analysis to process items from now on."""


@dataclass(frozen=True)
class NodeSpec:
    """Specification of one analysis for its actor."""

    stream: str
    work: Analytics[Any]
    inputs: dict[str, int]
    """Input streams and their queue depths."""
    robot: str
    """Robot that its data belongs to, or that it commands."""
    state: str
    """Stream of the vehicle states of that robot."""
    external: bool
    dormant: bool
    triggers: tuple[TriggerSpec, ...]
    acknowledges: bool
    """Whether mission time waits for each of its items, because its results have no readers."""
    kind: ComputeKind
    """Kind of compute node on which its actor runs."""
    answers_always: bool
    """Whether a dispatcher, or mission time, waits for an answer to each item."""
    wakes: tuple[str, ...]
    """Streams of the wake commands for a dormant analysis."""
    frames: tuple[str, ...] = ()
    """Streams of the frames that its tasks refer to."""


class Worker:
    """Loop of one analysis: receives, processes, publishes; serves as its `Context`."""

    state_depth = 1
    """Queue depth of the vehicle's states, of which the newest is used."""

    def __init__(self, actor: StreamActor, node: NodeSpec) -> None:
        """Worker of `node` in a thread of `actor`."""
        self.node = node
        # States come last: each is published before the measurements made in it, so that the
        # state of a received item is available, too.
        self.depths = {
            **dict.fromkeys(node.frames, FRAME_DEPTH),
            **node.inputs,
            **dict.fromkeys(node.wakes, _WAKE_DEPTH),
            node.state: self.state_depth,
        }
        self._link: StreamLink | None = None
        if isinstance(node.work, CommandingAnalytics):
            self._link = StreamLink(actor, node.stream, node.robot)
            self.depths.update(self._link.depths)
        self.busy = 0.0
        self.errors = 0
        self.last_error = ""
        self.opened = False
        self._at_work_since: float | None = None
        self._hung_since: float | None = None
        self._actor = actor
        self._woken: int | None = None if node.dormant else -1
        """Timestamp of the measurement that woke it; None while dormant."""
        self._states: deque[tuple[int, VehicleState]] = deque(maxlen=self.state_depth)
        self._now = 0
        self._frames = RecentFrames(node.frames)

    def open(self) -> None:
        """Open streams and analysis; raises the exceptions of its `open`."""
        name = type(self.node.work).__name__
        self.subscriber = self._actor.reader(self.depths, name)
        self._results = self._actor.publisher(self.node.stream, f"{name}'s result")
        self._triggers = Triggers(self.node.triggers, self._actor.publisher)
        if self._link is not None:
            self._link.open()
        self.node.work.open()
        self.opened = True

    def run(self) -> None:
        """Process items until the actor is stopped."""
        self._begin()
        turn = self._run_external if self.node.external else self._run_inputs
        while not self._actor.stopping:
            turn()

    def _begin(self) -> None:
        if self._link is None or not isinstance(self.node.work, CommandingAnalytics):
            return
        try:
            self.node.work.begin(self._link)
        except Exception as error:  # noqa: BLE001 - a user's analysis may raise anything
            self._complain(error)

    def _run_inputs(self) -> None:
        waiting = deque(self._receive(0.5))
        while waiting:
            message = waiting.popleft()
            if message.stream not in self.node.inputs:
                continue
            if not isinstance(message.item, FrameReference):
                self._work(message)
                continue
            if self._frames.find(message.item) is None:
                # Published before the task, the frame may have arrived since the last receive.
                waiting.extend(self._receive(0.0))
            frame = self._frames.find(message.item)
            if frame is not None:
                self._work(replace(message, item=frame.item))
            else:
                missing = MissingFrame(message.item)
                self._results.derive(missing, message, host_time_ns(), message.stamp)

    def _run_external(self) -> None:
        clock = self._actor.clock
        due = next_due(self._rate, clock.now())
        clock.sleep_until(due)
        self._receive(0.0)
        self._produce(due)

    @property
    def _rate(self) -> float:
        return self.node.work.rate

    def _produce(self, stamp: int) -> None:
        header = Header(self._results.sent, stamp, self.node.stream)
        captured = host_time_ns()
        awake = self._awake(stamp)
        item = self._process(None, stamp) if awake else None
        if item is not None:
            origin = Message(self.node.stream, header.id, stamp, header, captured, (), item)
            self._triggers.fire(item, origin, self._stamp(origin), self._complain)
        if awake or self.node.answers_always:
            self._processed(self._results.measure(item, header, captured))

    def _receive(self, timeout: float) -> list[Message[Any]]:
        """Store and return the messages that have arrived."""
        messages = self._arrived(timeout)
        for message in messages:
            self._actor.follow(message.stamp)
            self._frames.note(message)
            if self._link is not None:
                self._link.note(message)
            if message.stream == self.node.state and message.item is not None:
                self._states.append((message.stamp, message.item))
            elif isinstance(message.item, Wake):
                stamp = message.header.stamp
                self._woken = stamp if self._woken is None else min(self._woken, stamp)
        return messages

    def _arrived(self, timeout: float) -> list[Message[Any]]:
        return self.subscriber.receive(timeout)

    def _awake(self, stamp: int) -> bool:
        """Return whether a measurement at `stamp` is later than the wake command's."""
        return self._woken is not None and stamp > self._woken

    def _work(self, message: Message[Any]) -> None:
        received = host_time_ns()
        awake = self._awake(message.header.stamp)
        result = None
        if message.item is not None and awake:
            result = self._process(message.item, message.header.stamp)
        if result is not None:
            self._triggers.fire(result, message, self._stamp(message), self._complain)
        # An answer without a result records that this item was processed, and when.
        if awake or self.node.answers_always:
            self._results.derive(result, message, received, self._stamp(message))
        self._processed(message)

    def _processed(self, message: Message[Any]) -> None:
        """Called after each item, which `message` carried or carries now."""

    def _stamp(self, message: Message[Any]) -> int:
        """Mission time of what follows from `message`: now."""
        del message
        return self._actor.clock.now()

    def _process(self, item: Any, now: int) -> Any:  # noqa: ANN401
        self._now = now
        began = self._at_work_since = time.perf_counter()
        try:
            return self.node.work.process(item, self)
        except Exception as error:  # noqa: BLE001 - a user's analysis may raise anything
            self._complain(error)
            return None
        finally:
            self._at_work_since = None
            self.busy += time.perf_counter() - began

    def _complain(self, error: Exception) -> None:
        self.errors += 1
        line = f"{self.node.stream}: {failure_line(error)}"
        if line != self.last_error:
            self.last_error = line
            self._actor.tell("analysis_failed", line, self._now, {})

    def look_after(self) -> None:
        """Raise an alert, once per item, if processing takes too long."""
        since = self._at_work_since
        if since is None or since == self._hung_since or time.perf_counter() - since < _HUNG:
            return
        self._hung_since = since
        text = f"{self.node.stream} has been at one item for {_HUNG:.0f} s"
        self._actor.alert("analysis_hung", text)

    def wake(self) -> None:
        """End a wait for messages; thread-safe."""
        if self.opened:
            self.subscriber.wake()

    def close(self) -> None:
        """Close analysis and streams."""
        if self.opened:
            try:
                self.node.work.close()
            except Exception as error:  # noqa: BLE001 - a user's analysis may raise anything
                self._complain(error)
            self.subscriber.close()

    @property
    def kind(self) -> ComputeKind:
        """Kind of compute node on which the analysis runs."""
        return self.node.kind

    def now(self) -> int:
        """Mission time of the item in process, nanoseconds."""
        return self._now

    def vehicle(self) -> VehicleState | None:
        """The newest vehicle state; None before the first."""
        return self._states[-1][1] if self._states else None

    def alert(self, alert: Alert) -> None:
        """Publish an alert."""
        self._actor.tell(alert.kind, alert.text, alert.header.stamp, alert.values)
