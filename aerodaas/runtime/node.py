"""Node: one part of a flight, which an executor steps with the messages that it reads.

A node is a plain class. It knows no thread, no process and no transport: an executor opens it,
steps it when messages have arrived or its own time has come, and delivers what it returns. The
same nodes fly in one process on a simulated clock (`inline.py`) and in actors on Ray.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from aerodaas.clock import Clock, host_time_ns
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header

__all__ = ["LATENCIES_KEPT", "NEVER", "Host", "Latencies", "Node", "Outlet"]

NEVER = 2**63 - 1
"""A mission time that is never reached."""
LATENCIES_KEPT = 256
"""Newest latencies of a stream that reports tell the median and the tail of."""


class Host:
    """Base of what gives nodes the services of an executor; every method is thread-safe."""

    def now(self) -> int:
        """Mission time at this moment, nanoseconds."""
        raise NotImplementedError

    def alert(
        self,
        kind: str,
        text: str,
        stamp: int | None = None,
        values: Mapping[str, Any] | None = None,
        source: str = "",
    ) -> None:
        """Publish an alert to the operator.

        Args:
            kind: Short machine-readable name.
            text: One sentence for the operator.
            stamp: Mission time in nanoseconds; None for now.
            values: Further figures by name.
            source: Name of the part that raises it; empty for the host's own name.
        """
        at = self.now() if stamp is None else stamp
        self.publish_alert(kind, text, at, values or {}, source)

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str
    ) -> None:
        """Publish an alert, with every parameter of `alert` given.

        Args:
            kind: Kind of the alert.
            text: What it says.
            stamp: Mission clock, nanoseconds.
            values: Figures of the alert by name.
            source: Name of the part that raises it; empty for the host's own name.
        """
        raise NotImplementedError

    def wake(self) -> None:
        """Have the node stepped soon, even if no message arrives."""
        raise NotImplementedError


class Latencies:
    """The newest latencies, appended by one thread and read by others."""

    def __init__(self, kept: int) -> None:
        """Keep at least the newest `kept` values, and at most twice as many."""
        self._kept = kept
        self._values = array("d")

    def append(self, value: float) -> None:
        """Append the newest value, milliseconds."""
        self._values.append(value)
        if len(self._values) > 2 * self._kept:
            del self._values[: -self._kept]

    def newest(self, count: int) -> tuple[float, ...]:
        """The newest `count` values, newest last."""
        # A slice is made in one piece; an iteration would fail if another value came meanwhile.
        return tuple(self._values[-count:]) if count > 0 else ()


class Outlet:
    """One stream of a node: numbers its messages and measures their latency."""

    def __init__(self, stream: str) -> None:
        """Start `stream` with its first message."""
        self.stream = stream
        self.sent = 0
        """Number of messages made so far."""
        self.latencies = Latencies(LATENCIES_KEPT)
        """Milliseconds from capture to publishing, newest last."""

    def measure(self, item: Any, header: Header, captured: int) -> Message[Any]:  # noqa: ANN401
        """Make the first message of a path.

        Args:
            item: The measurement; None for none.
            header: Identity and mission time of the measurement.
            captured: Host time of its capture, nanoseconds.
        """
        span = TraceSpan(self.stream, captured, host_time_ns())
        return self._message(header.stamp, header, captured, (span,), item)

    def derive(
        self,
        item: Any,  # noqa: ANN401
        origin: Message[Any],
        received: int,
        stamp: int,
    ) -> Message[Any]:
        """Make the message of a result.

        Args:
            item: The result; None for none.
            origin: Message that the result was made from.
            received: Host time at which `origin` was received, nanoseconds.
            stamp: Mission time of the result, nanoseconds.
        """
        spans = (*origin.spans, TraceSpan(self.stream, received, host_time_ns()))
        return self._message(stamp, origin.header, origin.captured, spans, item)

    def _message(
        self,
        stamp: int,
        header: Header,
        captured: int,
        spans: tuple[TraceSpan, ...],
        item: Any,  # noqa: ANN401
    ) -> Message[Any]:
        self.latencies.append((spans[-1].published - captured) / 1e6)
        message = Message(self.stream, self.sent, stamp, header, captured, spans, item)
        self.sent += 1
        return message


class Node:
    """Base of the nodes.

    An executor calls `open` once, `start` when mission time begins, `step` any number of times and
    `close` at the end. A subclass that a test drives needs nothing else::

        node.open(host)
        node.start(clock)
        messages = node.step(now, inputs)
    """

    reads: dict[str, int]
    """Queue depth of each stream that the node reads, in the order in which one step's messages
    come."""
    outlets: dict[str, Outlet]
    """The streams that the node publishes."""
    waits_for_inputs = True
    """Whether a message is a reason to step; False for a node that takes the newest messages when
    its own time has come."""

    def __init__(self, name: str, reads: Mapping[str, int]) -> None:
        """Name the node; `reads` are queue depths by stream."""
        self.name = name
        self.reads = dict(reads)
        self.outlets = {}
        self.host: Host

    def outlet(self, stream: str) -> Outlet:
        """The outlet of `stream`, made on first use."""
        return self.outlets.setdefault(stream, Outlet(stream))

    def open(self, host: Host) -> None:
        """Open devices and models; raises AeroDaaSError if one cannot be opened."""
        self.host = host

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Begin the mission.

        Args:
            clock: Mission clock, for devices that stamp by it.

        Returns:
            Messages to publish at once.
        """
        del clock
        return ()

    @property
    def due(self) -> int:
        """Mission time of the next step without a message, nanoseconds; `NEVER` for none."""
        return NEVER

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Take the messages that have arrived, and do what is due.

        Args:
            now: Mission time, nanoseconds; it never runs backwards.
            inputs: New messages, each stream's in order.

        Returns:
            Messages to publish, in order.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Release what `open` acquired; called once, also after an `open` that raised."""

    def values(self) -> dict[str, Any]:
        """Figures for the report of its host."""
        return {}
