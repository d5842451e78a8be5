"""Inline executor: steps the nodes of a flight in one process, on a simulated clock.

Mission time jumps to the next moment at which a node is due. At each moment the drones are stepped
first, so that what measures them measures the vehicle's state of that moment; then messages are
handed on until none is left, in one fixed order of the nodes. Nothing depends on the host's speed,
so the same seed gives the same flight to the last digit.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any

from aerodaas.clock import SimulatedClock, seconds
from aerodaas.errors import AeroDaaSError, as_project_error, failure_line
from aerodaas.messages.envelope import Message
from aerodaas.runtime.node import NEVER, Host, Node
from aerodaas.runtime.reports import (
    ActorReport,
    AlertHandler,
    AlertLog,
    Phase,
    merged_values,
    sent_counts,
)

__all__ = ["InlineExecutor", "Part", "Tap"]

_TAP_DEPTH = 256


class Part(Host):
    """A named group of nodes with one report and one stream of alerts."""

    def __init__(self, name: str, executor: InlineExecutor) -> None:
        """Create the part `name` of a flight."""
        self.name = name
        self.phase: Phase = "new"
        self.error: AeroDaaSError | None = None
        self.nodes: list[Node] = []
        self.alerts = AlertLog(name)
        self._executor = executor

    def now(self) -> int:
        """Mission time, nanoseconds."""
        return self._executor.clock.now()

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str
    ) -> None:
        """Publish an alert, unless it repeats another one."""
        message = self.alerts.message(kind, text, stamp, values, source)
        if message is not None:
            self._executor.post(message)

    def wake(self) -> None:
        """Step the part's nodes soon."""
        self._executor.wake(self)

    def report(self) -> ActorReport:
        """Phase, counters, alerts and figures."""
        return ActorReport(
            phase=self.phase,
            error=self.error,
            sent=sent_counts(self.alerts.outlet, self.nodes),
            alerts=self.alerts.newest,
            values=merged_values(self.nodes),
        )


class Tap:
    """Reader of one stream for a thread beside the flight; buffers the newest messages."""

    def __init__(self) -> None:
        self._messages: deque[Message[Any]] = deque(maxlen=_TAP_DEPTH)
        self._arrived = threading.Condition()

    def put(self, message: Message[Any]) -> None:
        """Add a message; the oldest one goes if there are too many."""
        with self._arrived:
            self._messages.append(message)
            self._arrived.notify_all()

    def receive(self, timeout: float) -> list[Message[Any]]:
        """Return new messages; wait up to `timeout` seconds for them."""
        with self._arrived:
            self._arrived.wait_for(lambda: self._messages, timeout)
            messages = list(self._messages)
            self._messages.clear()
            return messages


@dataclass(eq=False)
class _Entry:
    node: Node
    part: Part
    positions: dict[str, int]
    """Place of each stream's messages in one step."""
    inbox: list[Message[Any]] = field(default_factory=list)
    due: int = NEVER
    woken: bool = False
    ended: bool = False
    """Whether it is stepped no more: it was closed, or raised."""

    def is_ready(self, now: int) -> bool:
        if self.ended:
            return False
        return self.due <= now or self.woken or (self.node.waits_for_inputs and bool(self.inbox))


class InlineExecutor:
    """Steps nodes in one thread; `post`, `wake` and `tap` are safe in any."""

    def __init__(self) -> None:
        """Start without nodes, at mission time zero."""
        self.clock = SimulatedClock()
        self.parts: dict[str, Part] = {}
        self._entries: list[_Entry] = []
        self._first: list[_Entry] = []
        """Entries of the nodes that are stepped before all others when their time comes."""
        self._readers: dict[str, list[_Entry]] = {}
        self._taps: dict[str, list[Tap]] = {}
        self._posted: SimpleQueue[Message[Any]] = SimpleQueue()
        self.part_at_work: Part | None = None
        """Part whose node is stepped, or was stepped last."""

    def add(self, part: str, nodes: Iterable[Node], *, first: bool = False) -> None:
        """Add nodes, stepped in the order in which they were added.

        Args:
            part: Name of the part that they report and raise alerts by.
            nodes: The nodes.
            first: Whether they simulate what others measure, and so are stepped before others at
                each of their own times.
        """
        group = self.parts.setdefault(part, Part(part, self))
        for node in nodes:
            entry = _Entry(node, group, {stream: at for at, stream in enumerate(node.reads)})
            group.nodes.append(node)
            self._entries.append(entry)
            for stream in node.reads:
                self._readers.setdefault(stream, []).append(entry)
            if first:
                self._first.append(entry)

    def order(self, nodes: Sequence[Node]) -> None:
        """Set the order in which ready nodes are stepped, in the place of that of adding."""
        places = {id(node): place for place, node in enumerate(nodes)}
        self._entries.sort(key=lambda entry: places[id(entry.node)])

    def _entry(self, node: Node) -> _Entry:
        return next(entry for entry in self._entries if entry.node is node)

    def open(self, nodes: Iterable[Node]) -> None:
        """Open added nodes; raises what the opening of one raises."""
        for node in nodes:
            part = self._entry(node).part
            node.open(part)
            part.phase = "ready"

    def start(self, nodes: Iterable[Node]) -> None:
        """Start opened nodes at the present mission time; one that raises ends."""
        for node in nodes:
            entry = self._entry(node)
            entry.part.phase = "running"
            self.part_at_work = entry.part
            try:
                published = node.start(self.clock)
            except BaseException as error:  # noqa: BLE001 - a plug-in may call exit(), too
                self._fail(entry, error, ())
                continue
            entry.due = node.due
            self._deliver(published)

    @property
    def next_moment(self) -> int:
        """Mission time at which a node is due next; `NEVER` if none is."""
        return min((entry.due for entry in self._entries if not entry.ended), default=NEVER)

    def advance_to(self, now: int) -> None:
        """Advance mission time to `now`, and do all that is due then."""
        self.clock.advance_to(now)
        for entry in self._first:
            if entry.due <= now and not entry.ended:
                self._step(entry, now)
        self.settle()

    def has_ended(self, node: Node) -> bool:
        """Whether a node is stepped no more."""
        return self._entry(node).ended

    def retire(self, nodes: Iterable[Node]) -> None:
        """Step these nodes no more by themselves."""
        for node in nodes:
            self._entry(node).ended = True

    def step(self, node: Node, now: int) -> None:
        """Step one node, and hand on what it publishes.

        Args:
            node: The node.
            now: Mission clock, nanoseconds.
        """
        self.clock.advance_to(now)
        self._step(self._entry(node), now)
        self.settle()

    def settle(self) -> None:
        """Hand on messages until none is left, at the present mission time."""
        now = self.clock.now()
        while True:
            self._deliver_posted()
            entry = next((entry for entry in self._entries if entry.is_ready(now)), None)
            if entry is None:
                return
            self._step(entry, now)

    def _step(self, entry: _Entry, now: int) -> None:
        inputs, entry.inbox, entry.woken = entry.inbox, [], False
        if len(inputs) > 1:
            positions = entry.positions
            inputs.sort(key=lambda message: positions[message.stream])
        self.part_at_work = entry.part
        try:
            published = entry.node.step(now, inputs)
        except BaseException as error:  # noqa: BLE001 - a plug-in may call exit(), too
            self._fail(entry, error, inputs)
            return
        entry.due = entry.node.due
        self._deliver(published)

    def _deliver(self, messages: Iterable[Message[Any]]) -> None:
        for message in messages:
            for entry in self._readers.get(message.stream, ()):
                if entry.ended:
                    continue
                if not entry.node.waits_for_inputs:
                    entry.inbox = [one for one in entry.inbox if one.stream != message.stream]
                entry.inbox.append(message)
            for tap in self._taps.get(message.stream, ()):
                tap.put(message)

    def _deliver_posted(self) -> None:
        while not self._posted.empty():
            self._deliver((self._posted.get(),))

    def _fail(self, entry: _Entry, error: BaseException, inputs: Sequence[Message[Any]]) -> None:
        """End a node whose step raised, and tell where."""
        entry.ended = True
        part = entry.part
        where = f"at {seconds(self.clock.now()):.3f} s of mission time"
        if inputs:
            where += f", with {inputs[-1].stream} #{inputs[-1].seq}"
        text = str(error) if isinstance(error, AeroDaaSError) else failure_line(error)
        part.error = AeroDaaSError(f"{entry.node.name}: {text} ({where})")
        part.phase = "failed"
        part.alert("actor_failed", str(part.error))

    def post(self, message: Message[Any]) -> None:
        """Deliver a message before the next step."""
        self._posted.put(message)

    def wake(self, part: Part) -> None:
        """Step the nodes of `part` at the next opportunity."""
        for entry in self._entries:
            if entry.part is part:
                entry.woken = True

    def tap(self, stream: str) -> Tap:
        """Start to read `stream` beside the flight."""
        tap = Tap()
        self._taps[stream] = [*self._taps.get(stream, ()), tap]
        return tap

    def publishes(self, stream: str) -> bool:
        """Whether a node publishes `stream`."""
        return any(stream in entry.node.outlets for entry in self._entries)

    def close(self) -> None:
        """Close all nodes in their order; what closing raises becomes the part's error.

        A recorder that was added last records what the others tell while they close.
        """
        for entry in self._entries:
            self.settle()
            entry.ended = True
            try:
                entry.node.close()
            except BaseException as error:  # noqa: BLE001 - a plug-in may call exit(), too
                entry.part.error = entry.part.error or as_project_error(entry.node.name, error)
            if entry.part.phase in {"ready", "running"}:
                entry.part.phase = "done"

    def log_handler(self) -> logging.Handler:
        """A handler that publishes warnings as alerts of the part at work."""

        def alert(kind: str, text: str) -> None:
            if self.part_at_work is not None:
                self.part_at_work.alert(kind, text)

        return AlertHandler(alert)
