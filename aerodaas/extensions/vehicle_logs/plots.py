"""A plot of the main topics of a vehicle's own log, over mission time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from aerodaas.extensions.vehicle_logs.attachment import AttachedLog, attached_logs
from aerodaas.extensions.vehicle_logs.log import Floats, Topic, VehicleLog
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.section import Drawing, ReportSection
from aerodaas.text.printable import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["log_drawing", "log_sections"]

_ROW = 1.5
"""Inches of one row."""
_AROUND = 5.0
"""Seconds shown before and after the flight."""
_TURN = 180.0
"""Degrees between two headings that are no turn, but the step at north."""

_Row: TypeAlias = tuple[str, Sequence[tuple[Topic, str, str]]]
"""Label of a row's axis, and its lines: topic, column, name in the legend."""


def log_drawing(number: int, attached: AttachedLog) -> Drawing | None:
    """The plot of a log; None without data for it.

    Args:
        number: The log's number among those of the recording, from 1.
        attached: The log.
    """
    rows = [] if attached.log is None else _rows(attached.log)
    if not rows:
        return None
    title = "From the autopilot's log"
    description = f"{title}: its main topics over mission time"
    return Drawing(f"vehicle_log_{number}", title, description, lambda: _figure(attached, rows))


def _rows(log: VehicleLog) -> list[_Row]:
    rows: list[_Row] = [
        ("Voltage (V)", [("battery", "voltage", "")]),
        ("Current (A)", [("battery", "current", "")]),
    ]
    for angle in ("roll", "pitch", "heading"):
        lines: list[tuple[Topic, str, str]] = [
            ("attitude", angle, "measured"),
            ("attitude setpoint", angle, "setpoint"),
        ]
        rows.append((f"{angle.capitalize()} (°)", lines))
    # As many lines as the vehicle has axes or motors.
    labels: dict[Topic, str] = {"vibration": "Vibration (m/s²)", "motors": "Motors (%)"}
    for topic, label in labels.items():
        names = log.topics[topic].columns if topic in log.topics else ()
        rows.append((label, [(topic, name, name) for name in names]))
    held = [(label, [line for line in lines if _holds(log, *line)]) for label, lines in rows]
    return [(label, lines) for label, lines in held if lines]


def _holds(log: VehicleLog, topic: Topic, column: str, _: str) -> bool:
    """Whether a log has any figure for a line."""
    values = log.topics[topic].columns.get(column) if topic in log.topics else None
    return values is not None and bool(np.isfinite(values).any())


def _figure(attached: AttachedLog, rows: Sequence[_Row]) -> Figure:
    from aerodaas.recording.report.plots.style import (  # noqa: PLC0415 - needs the extra `plots`
        CYCLE,
        grid,
        new_figure,
    )

    figure = new_figure(1.1 + _ROW * len(rows))
    all_axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (label, lines) in zip(all_axes, rows, strict=True):
        for (topic, column, name), (colour, style) in zip(lines, CYCLE, strict=False):
            dashed = "--" if topic.endswith("setpoint") else style
            time, values = _line(attached, topic, column)
            axes.plot(time, values, dashed, color=colour, linewidth=1.2, label=name)
        if lines[0][-1]:
            axes.legend(loc="upper right", ncols=4, frameon=False, fontsize=8)
        axes.margins(x=0)
        axes.set_ylabel(label)
        grid(axes, "y")
    all_axes[-1].set_xlabel("Mission time (s)")
    robot = f"{attached.robot}, " if attached.robot else ""
    autopilot = attached.log.autopilot if attached.log else ""
    all_axes[0].set_title(f"{robot}{autopilot}'s log {attached.file}", fontsize=9, loc="left")
    return figure


def _line(attached: AttachedLog, topic: Topic, column: str) -> tuple[Floats, Floats]:
    """One column over mission seconds, around the flight and in order; see `_TURN` of a heading."""
    if attached.log is None or attached.alignment is None:
        return np.empty(0), np.empty(0)
    series, told = attached.log.topics[topic], attached.alignment
    time, values = told.clock.mission_time(series.time), series.columns[column]
    begin, end = told.flown[0] - _AROUND, told.flown[1] + _AROUND
    # What is drawn outside of the axes would still stretch them.
    shown = np.isfinite(values) & (time >= begin) & (time <= end)
    time, values = time[shown], values[shown]
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    if column == "heading":
        steps = np.flatnonzero(np.abs(np.diff(values)) > _TURN) + 1
        time, values = np.insert(time, steps, time[steps]), np.insert(values, steps, np.nan)
    return time, values


_HEAD = ("at (s)", "severity", "message of the autopilot")
_MOST_TEXTS = 200
"""Messages of an autopilot that are listed."""
_MOST_LOGS = 6
"""Logs that are drawn."""


def log_sections(recording: Recording) -> list[ReportSection]:
    """A section for each attached log: its messages, and a plot of its main topics."""
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
    drawing = log_drawing(number, attached) if number <= _MOST_LOGS else None
    return ReportSection(title, text, _HEAD, rows, note, () if drawing is None else (drawing,))
