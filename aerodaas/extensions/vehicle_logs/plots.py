"""Plots of the main topics of vehicles' own logs, over mission time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from aerodaas.extensions.vehicle_logs.attachment import AttachedLog, attached_logs
from aerodaas.extensions.vehicle_logs.log import Floats, Topic, VehicleLog
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.section import Drawing, ReportSection
from aerodaas.text.printable import printable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

__all__ = ["log_drawings", "log_sections"]

_ROW = 1.5
"""Inches of one row."""
_AROUND = 5.0
"""Seconds shown before and after the flight."""
_TURN = 180.0
"""Degrees between two headings that are no turn, but the step at north."""
_COLUMNS = ("east", "north", "up")
_ANGLES = ("roll", "pitch", "heading")

_Rows = Sequence[tuple[str, Sequence[tuple[Topic, str, str]]]]
"""Label of each row's axis, and its lines: topic, column, name in the legend."""


def log_drawings(number: int, attached: AttachedLog) -> Iterator[Drawing]:
    """The plots that a log has data for.

    Args:
        number: The log's number among those of the recording, from 1.
        attached: The log.
    """
    log = attached.log
    if log is None:
        return
    for name, what, rows in (*_FIGURES, *_variable(attached)):
        known = [(label, [line for line in lines if _holds(log, *line)]) for label, lines in rows]
        shown = [(label, lines) for label, lines in known if lines]
        if shown:
            title = f"From the autopilot's log: {what}"
            file, description = f"vehicle_log_{number}_{name}", f"{title} over mission time"
            yield Drawing(file, title, description, _maker(attached, shown))


def _holds(log: VehicleLog, topic: Topic, column: str, _: str) -> bool:
    """Whether a log has any figure for a line."""
    values = log.topics[topic].columns.get(column) if topic in log.topics else None
    return values is not None and bool(np.isfinite(values).any())


_FIGURES: tuple[tuple[str, str, _Rows], ...] = (
    (
        "battery",
        "battery",
        (
            ("Voltage (V)", [("battery", "voltage", "")]),
            ("Current (A)", [("battery", "current", "")]),
        ),
    ),
    (
        "attitude",
        "attitude and its setpoint",
        [
            (
                f"{angle.capitalize()} (°)",
                [("attitude", angle, "measured"), ("attitude setpoint", angle, "setpoint")],
            )
            for angle in _ANGLES
        ],
    ),
    (
        "position",
        "position and its setpoint",
        [
            (
                f"{axis.capitalize()} (m)",
                [("position", axis, "estimated"), ("position setpoint", axis, "setpoint")],
            )
            for axis in _COLUMNS
        ],
    ),
    (
        "gps",
        "GPS",
        (
            (
                "Accuracy (m)",
                [
                    ("gps accuracy", "horizontal", "horizontal"),
                    ("gps accuracy", "vertical", "vertical"),
                ],
            ),
            ("Satellites", [("gps satellites", "satellites", "")]),
        ),
    ),
)


def _variable(attached: AttachedLog) -> Iterator[tuple[str, str, _Rows]]:
    """Plots with as many lines as the vehicle has axes or motors."""
    topics = attached.log.topics if attached.log else {}
    told: tuple[tuple[Topic, str, str], ...] = (
        ("vibration", "vibration", "Vibration (m/s²)"),
        ("motors", "motors", "Motors (%)"),
    )
    for topic, what, label in told:
        if topic in topics:
            yield topic, what, [(label, [(topic, name, name) for name in topics[topic].columns])]


def _maker(attached: AttachedLog, rows: _Rows) -> Callable[[], Figure]:
    return lambda: _figure(attached, rows)


def _figure(attached: AttachedLog, rows: _Rows) -> Figure:
    from aerodaas.recording.report.plots.style import (  # noqa: PLC0415 - needs the extra `plots`
        CYCLE,
        grid,
        legend,
        new_figure,
    )

    figure = new_figure(1.1 + _ROW * len(rows))
    all_axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    handles: dict[str, Artist] = {}
    for axes, (label, lines) in zip(all_axes, rows, strict=True):
        for (topic, column, name), (colour, style) in zip(lines, CYCLE, strict=False):
            dashed = "--" if topic.endswith("setpoint") else style
            time, values = _line(attached, topic, column)
            (line,) = axes.plot(time, values, dashed, color=colour, linewidth=1.2, label=name)
            if name:
                handles.setdefault(name, line)
        axes.margins(x=0)
        axes.set_ylabel(label)
        grid(axes, "y")
    all_axes[-1].set_xlabel("Mission time (s)")
    robot = f"{attached.robot}, " if attached.robot else ""
    autopilot = attached.log.autopilot if attached.log else ""
    all_axes[0].set_title(f"{robot}{autopilot}'s log {attached.file}", fontsize=9, loc="left")
    legend(figure, list(handles.values()), columns=4)
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
