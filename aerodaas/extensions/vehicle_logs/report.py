"""Sections of attached logs in the report of a recording."""

from __future__ import annotations

import numpy as np

from aerodaas.extensions.vehicle_logs.attachment import AttachedLog, attached_logs
from aerodaas.extensions.vehicle_logs.plots import log_drawings
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.section import ReportSection
from aerodaas.text.printable import printable

__all__ = ["log_sections"]

_HEAD = ("at (s)", "severity", "message of the autopilot")
_MOST_TEXTS = 200
"""Messages of an autopilot that are listed."""
_MOST_LOGS = 6
"""Logs whose plots are drawn, six of each."""


def log_sections(recording: Recording) -> list[ReportSection]:
    """A section for each attached log: its messages, and plots of its main topics."""
    return [_section(number, log) for number, log in enumerate(attached_logs(recording), 1)]


def _section(number: int, attached: AttachedLog) -> ReportSection:
    title, text = "The autopilot's own log", str(attached)
    if attached.log is None or attached.alignment is None:
        return ReportSection(title, text)
    texts, clock = attached.log.texts, attached.alignment.clock
    rows = [
        (f"{clock.mission_time(np.array(one.time)):.1f}", one.severity, printable(one.text))
        for one in texts[:_MOST_TEXTS]
    ]
    left_out = len(texts) - len(rows)
    note = f"{left_out} more messages are in the log." if left_out else ""
    drawings = tuple(log_drawings(number, attached)) if number <= _MOST_LOGS else ()
    return ReportSection(title, text, _HEAD, rows, note, drawings)
