"""Alerts of one part of a run: numbered, without repetitions, the newest ones kept."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.readings import Alert
from aerodaas.runtime.node import Outlet
from aerodaas.runtime.stream_names import alert_stream

__all__ = ["AlertHandler", "AlertLog"]

_KEPT = 50
_REPEATED = 5 * NANOSECONDS
"""Mission time within which an alert with the same text is suppressed, nanoseconds."""


class AlertLog:
    """Alerts of one part of a run; thread-safe."""

    def __init__(self, name: str) -> None:
        """Start the alerts of the part `name`."""
        self.outlet = Outlet(alert_stream(name))
        self.newest: deque[Alert] = deque(maxlen=_KEPT)
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
            self.newest.append(alert)
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
