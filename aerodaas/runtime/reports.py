"""Reports and alerts of a run: of each robot, of each part that runs nodes, and of the whole."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import RobotStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vitals import Vitals
from aerodaas.runtime.node import LATENCIES_KEPT, Node, Outlet
from aerodaas.runtime.stream_names import alert_stream

__all__ = [
    "ActorReport",
    "AlertHandler",
    "AlertLog",
    "FlightState",
    "Phase",
    "SentCount",
    "StreamCount",
    "merged_values",
    "sent_counts",
]

Phase = Literal["new", "ready", "running", "done", "failed"]


@dataclass(frozen=True)
class StreamCount:
    """Messages of one stream received and dropped by a part."""

    received: int
    dropped: int


@dataclass(frozen=True)
class SentCount:
    """Messages published by a part on one stream, and their latency."""

    count: int
    median_ms: float | None
    """Latency from capture to publishing of the newest messages; None before the first."""
    p99_ms: float | None

    @classmethod
    def of(cls, count: int, latencies: Sequence[float]) -> SentCount:
        """The count of a stream's messages.

        Args:
            count: Messages sent.
            latencies: Of the newest of them, milliseconds.
        """
        if not latencies:
            return cls(count, None, None)
        ordered = sorted(latencies)
        last = len(ordered) - 1
        return cls(count, ordered[len(ordered) // 2], ordered[int(0.99 * last)])


@dataclass(frozen=True)
class ActorReport:
    """Status of a part, in real time an actor: phase, counters, vitals, alerts and problems."""

    phase: Phase
    error: AeroDaaSError | None = None
    streams: dict[str, StreamCount] = field(default_factory=dict)
    sent: dict[str, SentCount] = field(default_factory=dict)
    vitals: Vitals | None = None
    """Vitals of its process; None before its first report."""
    alerts: tuple[Alert, ...] = ()
    """The newest alerts, oldest first."""
    problems: tuple[str, ...] = ()
    """Descriptions of items that could not be sent or read."""
    values: dict[str, Any] = field(default_factory=dict)
    """Figures specific to the kind of part."""


def sent_counts(alerts: Outlet, nodes: Iterable[Node]) -> dict[str, SentCount]:
    """Messages published, by stream.

    Args:
        alerts: Stream of alerts.
        nodes: Nodes of one report.
    """
    outlets = [alerts, *(outlet for node in nodes for outlet in tuple(node.outlets.values()))]
    return {
        outlet.stream: SentCount.of(outlet.sent, outlet.latencies.newest(LATENCIES_KEPT))
        for outlet in outlets
    }


def merged_values(nodes: Iterable[Node]) -> dict[str, Any]:
    """Figures of the nodes of one report; tables and lists of the same name are joined."""
    values: dict[str, Any] = {}
    for node in nodes:
        for name, value in node.values().items():
            if isinstance(value, dict):
                values.setdefault(name, {}).update(value)
            elif isinstance(value, list):
                values.setdefault(name, []).extend(value)
            else:
                values[name] = value
    return values


@dataclass(frozen=True)
class FlightState:
    """State of a run at one time."""

    robots: dict[str, RobotStatus]
    reports: dict[str, ActorReport]
    over: bool
    """True after every mission has ended."""
    notes: tuple[Alert, ...] = ()
    """The newest alerts of the application's own process."""

    @property
    def alerts(self) -> list[Alert]:
        """The newest alerts of all parts and of the application's process, oldest first."""
        noted = {(note.kind, note.text) for note in self.notes}
        alerts = [
            alert
            for report in self.reports.values()
            for alert in report.alerts
            # The drones' actors repeat the application's, so that they are recorded.
            if (alert.kind, alert.text) not in noted
        ]
        return sorted([*self.notes, *alerts], key=lambda alert: alert.header.stamp)


_KEPT = 50
_REPEATED = 5 * NANOSECONDS
"""Mission time within which an alert with the same text is suppressed, nanoseconds."""


class AlertLog:
    """Alerts of one part of a run; thread-safe."""

    def __init__(self, name: str) -> None:
        """Start the alerts of the part `name`."""
        self.outlet = Outlet(alert_stream(name))
        self.newest: tuple[Alert, ...] = ()
        """The newest alerts, oldest first."""
        self._name = name
        self._lock = threading.Lock()
        self._raised: dict[tuple[str, str, str], int] = {}
        """Mission time of each of the newest alerts, by source, kind and text."""

    def message(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str = ""
    ) -> Message[Alert] | None:
        """Make the message of an alert; None if the same one was made within the last seconds.

        Args:
            kind: Short machine-readable name.
            text: One sentence for the operator.
            stamp: Mission time in nanoseconds.
            values: Further figures by name.
            source: Name of the part that raises it; empty for this one.
        """
        source = source or self._name
        with self._lock:
            before = self._raised.get((source, kind, text))
            if before is not None and 0 <= stamp - before < _REPEATED:
                return None
            self._raised[source, kind, text] = stamp
            while len(self._raised) > _KEPT:
                self._raised.pop(next(iter(self._raised)))
            header = Header(self.outlet.sent, stamp, source)
            alert = Alert(header, kind, text, dict(values))
            self.newest = (*self.newest[1 - _KEPT :], alert)
            return self.outlet.measure(alert, header, host_time_ns())


class AlertHandler(logging.Handler):
    """Publishes the warnings of the project's own modules as alerts."""

    def __init__(self, alert: Callable[[str, str], None]) -> None:
        """Publish by `alert`, which takes kind and text."""
        super().__init__(logging.WARNING)
        self._alert = alert

    def emit(self, record: logging.LogRecord) -> None:
        """Publish one record."""
        self._alert("warning", record.getMessage())
