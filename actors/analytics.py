"""Analytics actor: runs one or several analyses, each in a thread of its own.

Light analyses share an actor, because an actor costs 70 MB; an `isolated` one, such as a neural
network, has its own.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.actors.base import ActorInfo, StreamActor, StreamCount, failure_line
from aerodaas.actors.dispatch.recent_frames import FrameReference, MissingFrame, RecentFrames
from aerodaas.actors.drone.mission_link import StreamLink
from aerodaas.actors.session import FRAME_DEPTH, MESSAGE_DEPTH, Session, next_due
from aerodaas.actors.stream_names import ACKS
from aerodaas.actors.streams import Publisher
from aerodaas.actors.triggers import Triggers, TriggerSpec
from aerodaas.analytics.base import Analytics, ComputeKind
from aerodaas.analytics.commanding import CommandingAnalytics
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Alert, Header
from aerodaas.types.status import Message
from aerodaas.types.vehicle import VehicleState

__all__ = ["AnalyticsActor", "NodeSpec", "TriggerSpec", "Wake"]

_WAKE_DEPTH = 8
_LOOK_INTERVAL = 1.0
_PARTING = 3.0
"""Wall seconds that an analysis has to finish its item after the end of the run."""
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
    """True in lockstep for an analysis whose results have no readers."""
    kind: ComputeKind
    """Kind of compute node on which its actor runs."""
    answers_always: bool
    """True if a dispatcher waits for an answer to each task."""
    wakes: tuple[str, ...]
    """Streams of the wake commands for a dormant analysis."""
    frames: tuple[str, ...] = ()
    """Streams of the frames that its tasks refer to."""


class AnalyticsActor(StreamActor):
    """Actor that runs the analyses passed to `prepare`."""

    def __init__(self, session: Session, name: str) -> None:
        """Create the actor `name` of `session`."""
        super().__init__(session, name, {})
        self._workers: list[_Worker] = []
        self._threads: list[threading.Thread] = []

    def prepare(self, *nodes: NodeSpec) -> ActorInfo:
        """Open the analyses `nodes`; raises the exceptions of their `open`."""
        # Not in the constructor: Ray would keep the models in its object store for restarts.
        self._workers = [_Worker(self, node) for node in nodes]
        return super().prepare()

    def join(self, *nodes: NodeSpec) -> ActorInfo:
        """Run further analyses in flight; none of them if the `open` of one raises."""
        fresh = [_Worker(self, node) for node in nodes]
        before = set(self.publishers)
        try:
            for worker in fresh:
                worker.open()
        except BaseException:
            for worker in fresh:
                worker.close()
            for stream in set(self.publishers) - before:
                self.publishers.pop(stream).close()
            raise
        self._workers += fresh
        for worker in fresh:
            self._begin(worker)
        return self.info()

    def acknowledge(self, streams: dict[str, bool]) -> None:
        """In lockstep, set whether the analyses of these streams acknowledge their items."""
        for worker in self._workers:
            if worker.node.stream in streams:
                worker.acknowledge(wanted=streams[worker.node.stream])

    def _open(self) -> None:
        for worker in self._workers:
            worker.open()

    def _begin(self, worker: _Worker) -> None:
        thread = threading.Thread(target=worker.run, name=worker.node.stream, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _run(self) -> None:
        for worker in self._workers:
            self._begin(worker)
        given_up = math.inf
        while any(one.is_alive() for one in self._threads) and time.monotonic() < given_up:
            if self.stopping:
                given_up = min(given_up, time.monotonic() + _PARTING)
            for thread in tuple(self._threads):
                thread.join(_LOOK_INTERVAL / len(self._threads))
            for worker in self._workers:
                worker.look_after()

    def _close(self) -> None:
        for worker in self._workers:
            worker.close()

    def deliver(self, stream: str, data: bytes) -> None:
        """Deliver a message from another node to every analysis that reads it."""
        for worker in self._workers:
            if stream in worker.subscriber.received:
                worker.subscriber.deliver(stream, data)

    def stop(self) -> Any:  # noqa: ANN401 - the base's report
        """Finish current items, close everything, and return the final report."""
        self._stopping.set()
        for worker in self._workers:
            worker.wake()
        return super().stop()

    def reads(self) -> list[str]:
        """Names of the streams that this actor's analyses read."""
        return sorted({stream for worker in self._workers for stream in worker.depths})

    def counts(self) -> dict[str, StreamCount]:
        """Messages received and dropped by each analysis, by `stream>analysis`."""
        return {
            f"{stream}>{worker.node.stream}": StreamCount(
                worker.subscriber.received[stream], worker.subscriber.dropped[stream]
            )
            for worker in self._workers
            if worker.opened
            for stream in worker.node.inputs
        }

    def _values(self) -> dict[str, Any]:
        return {
            "busy_seconds": {worker.node.stream: worker.busy for worker in self._workers},
            "errors": {w.node.stream: w.errors for w in self._workers if w.errors},
            "last_errors": [w.last_error for w in self._workers if w.last_error],
        }


class _Worker:
    """Loop of one analysis: receives, processes, publishes; serves as its `Context`."""

    def __init__(self, actor: AnalyticsActor, node: NodeSpec) -> None:
        self.node = node
        states = MESSAGE_DEPTH if actor.session.lockstep else 1
        # States come last: each is published before the measurements made in it, so that the
        # state of a received item is available, too.
        self.depths = {
            **dict.fromkeys(node.frames, FRAME_DEPTH),
            **node.inputs,
            **dict.fromkeys(node.wakes, _WAKE_DEPTH),
            node.state: states,
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
        self._states: deque[tuple[int, VehicleState]] = deque(maxlen=states)
        self._now = 0
        self._frames = RecentFrames(node.frames)

    def open(self) -> None:
        session = self._actor.session
        name = type(self.node.work).__name__
        self.subscriber = self._actor.reader(f"analytics/{self.node.stream}", self.depths, name)
        self._results = self._actor.publisher(self.node.stream, f"{name}'s result")
        self._triggers = Triggers(self.node.triggers, self._actor.publisher)
        self._acks: Publisher | None = None
        if session.lockstep:
            self.acknowledge(wanted=self.node.acknowledges)
        if self._link is not None:
            self._link.open()
        self.node.work.open()
        self.opened = True

    def acknowledge(self, *, wanted: bool) -> None:
        """Start or stop to acknowledge processed items."""
        stream = f"{ACKS}/{self.node.stream}"
        known = self._actor.publishers.get(stream)
        self._acks = (known or self._actor.publisher(stream)) if wanted else None

    def run(self) -> None:
        self._begin()
        turn = self._run_external if self.node.external else self._run_inputs
        if self.node.external and not self._actor.session.lockstep:
            turn = self._run_paced
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
        """In lockstep, measure at the timestamps of the drone's states."""
        for message in self._receive(0.5):
            due = self._actor.session.is_due(self.node.stream, self._rate, message.stamp)
            if message.stream == self.node.state and due:
                self._produce(message.stamp)

    def _run_paced(self) -> None:
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
        if awake or self._actor.session.lockstep:
            self._acknowledge(self._results.measure(item, header, captured))

    def _receive(self, timeout: float) -> list[Message[Any]]:
        """Store and return the messages that have arrived."""
        messages = self.subscriber.receive(timeout)
        if messages and self._actor.session.lockstep:
            # A state is published before the measurements made in it, but may arrive in between.
            messages += self.subscriber.receive(0.0)
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
        if awake or self._actor.session.lockstep or self.node.answers_always:
            self._results.derive(result, message, received, self._stamp(message))
        self._acknowledge(message)

    def _stamp(self, message: Message[Any]) -> int:
        return message.stamp if self._actor.session.lockstep else self._actor.clock.now()

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

    def _acknowledge(self, message: Message[Any]) -> None:
        if self._acks is not None:
            done = ((message.header.source, message.header.stamp),)
            self._acks.derive(done, message, host_time_ns(), message.stamp)

    def look_after(self) -> None:
        """Raise an alert, once per item, if processing takes too long."""
        since = self._at_work_since
        if since is None or since == self._hung_since or time.perf_counter() - since < _HUNG:
            return
        self._hung_since = since
        text = f"{self.node.stream} has been at one item for {_HUNG:.0f} s"
        self._actor.alert("analysis_hung", text)

    def wake(self) -> None:
        if self.opened:
            self.subscriber.wake()

    def close(self) -> None:
        if self.opened:
            with contextlib.suppress(Exception):
                self.node.work.close()
            self.subscriber.close()

    @property
    def kind(self) -> ComputeKind:
        return self.node.kind

    def now(self) -> int:
        return self._now

    def vehicle(self) -> VehicleState | None:
        """The newest vehicle state; in lockstep the newest at the item's own time."""
        lockstep = self._actor.session.lockstep
        states = reversed(self._states)
        return next((s for at, s in states if at <= self._now or not lockstep), None)

    def alert(self, alert: Alert) -> None:
        # In lockstep only the messages carry the right time, not the actor's clock.
        self._actor.tell(alert.kind, alert.text, alert.header.stamp, alert.values)
