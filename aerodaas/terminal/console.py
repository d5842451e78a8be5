"""Terminal output of a run: its start, the live view, and the places of the results."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.status import Status
from typing_extensions import Self

from aerodaas.clock import seconds
from aerodaas.config.extras import has_extra
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions
from aerodaas.errors import RecordingError
from aerodaas.identifiers import is_internal
from aerodaas.terminal.live import FlightDisplay
from aerodaas.terminal.panels import Snapshot, StreamSnapshot

if TYPE_CHECKING:
    from aerodaas.runtime.reports import FlightState

__all__ = [
    "FlightView",
    "StartupView",
    "show_console",
    "show_headless",
    "show_left",
    "show_results",
    "show_speed",
]

_ALERTS_SHOWN = 4
_NAMES = len("recording")
"""Columns of the names of a run's files."""


class StartupView:
    """Shows the progress of a run's start: on a terminal each step, in a pipe those that last."""

    def __init__(self, options: RunOptions) -> None:
        self._console = Console(highlight=False)
        self._shown = options.view
        self._stack = ExitStack()
        self._status: Status | None = None
        self._begun = ""

    def __enter__(self) -> Self:
        console = self._console
        if self._shown and console.is_terminal and not console.is_dumb_terminal:
            self._status = self._stack.enter_context(console.status("starting"))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def begin(self, text: str) -> None:
        """Show that a step has begun that may take long."""
        if self._status is not None:
            self._status.update(text)
        elif self._shown and text != self._begun:
            self._begun = text
            self._console.print(f"{text} …", markup=False)

    def step(self, text: str) -> None:
        """Show that a part is ready."""
        if self._status is not None:
            self._status.update(text)


class FlightView(FlightDisplay):
    """View of a flight in progress: its alerts at any time, the rest while it is entered."""

    def __init__(self, options: RunOptions, config: EnvironmentConfig) -> None:
        super().__init__(shown=options.view)
        self._title = options.application.stem if options.application else config.name
        self._printed: set[tuple[str, int, int]] = set()
        """The newest alerts, by source, number and stamp."""
        self._before: tuple[float, dict[str, int]] = (0.0, {})
        self._rates: dict[str, float] = {}

    def print_alerts(self, state: FlightState) -> None:
        """Print a line for each new alert, unless they are shown on the terminal anyway."""
        before, self._printed = self._printed, set()
        for alert in state.alerts:
            key = alert.header.source, alert.header.id, alert.header.stamp
            self._printed.add(key)
            if key not in before and not self.moves:
                time_text = f"{seconds(alert.header.stamp):.1f} s"
                self.say(f"{time_text} {alert.header.source}: {alert.text}")

    def update(self, state: FlightState) -> None:
        """Show the flight's present state, but for its alerts in a pipe."""
        if self._view is None:
            return
        stamps = [robot.mission.stamp for robot in state.robots.values()]
        now = seconds(max(stamps, default=0))
        self._measure_rates(state, now)
        self._view.update(
            Snapshot(
                title=self._title,
                mission_time=now,
                wall_time=time.monotonic() - self._began,
                robots=state.robots,
                streams=(*self._streams(state), *_commands(state)),
                alerts=tuple(alert.text for alert in state.alerts[-_ALERTS_SHOWN:]),
                scheduler=_scheduler_text(state),
            )
        )

    def _measure_rates(self, state: FlightState, now: float) -> None:
        counts = {
            stream: sent.count
            for report in state.reports.values()
            for stream, sent in report.sent.items()
        }
        before, earlier = self._before
        if counts == earlier or now <= before:
            return
        # Over the whole flight so far: in simulated time short intervals of wall time vary much.
        self._rates = {stream: count / now for stream, count in counts.items()}
        self._before = now, counts

    def _streams(self, state: FlightState) -> list[StreamSnapshot]:
        dropped: dict[str, int] = {}
        for report in state.reports.values():
            for name, count in report.streams.items():
                stream = name.partition(">")[0]
                dropped[stream] = max(dropped.get(stream, 0), count.dropped)
        return [
            StreamSnapshot(
                stream, self._rates.get(stream), sent.median_ms, sent.p99_ms, dropped.get(stream, 0)
            )
            for name, report in state.reports.items()
            if not name.startswith(("drone/", "dispatcher"))
            for stream, sent in report.sent.items()
            if not is_internal(stream)
        ]


def _scheduler_text(state: FlightState) -> str:
    """Figures of the analytics scheduler; empty before its first decision."""
    report = state.reports.get("dispatcher")
    values = report.values if report is not None else {}
    ended = sum(values.get("outcomes", {}).values())
    if not ended:
        return ""
    outcomes = ", ".join(
        f"{count} {name}" for name, count in values["outcomes"].items() if name != "done"
    )
    windows = [sum(counts) for counts in zip(*values["qoe_windows"].values(), strict=True)]
    share = 100 * values["outcomes"].get("done", 0) / ended
    head = f"{values['scheduler']}: {share:.0f} % of {ended} in time"
    parts = [f"{head}, {outcomes}" if outcomes else head, f"utility {values['qos_total']:.0f}"]
    if windows:
        parts.append(f"QoE {values['qoe_total']:.0f} ({windows[0]} of {windows[1]} windows)")
    if values["edge_down"]:
        parts.append(f"down: {', '.join(values['edge_down'])}")
    return "; ".join(parts)


def _commands(state: FlightState) -> list[StreamSnapshot]:
    rows = []
    for name, robot in state.robots.items():
        if robot.latencies:
            ordered = sorted(robot.latencies)
            high = ordered[int(0.99 * (len(ordered) - 1))]
            rows.append(
                StreamSnapshot(
                    f"{name}: capture to command", None, statistics.median(ordered), high
                )
            )
    return rows


def show_console(flies: str, watches: str) -> None:
    """Print the console's address for who flies, and the one for who only watches."""
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"console: open {flies}", markup=False)
    console.print(f"  to watch only: {watches}", markup=False)


def show_speed(options: RunOptions, mission: float, wall: float, start: float) -> None:
    """Print the wall time of a mission of `mission` seconds, and of its start before that."""
    if options.view and wall > 0:
        factor = f"{mission / wall:.1f} times as fast as the clock"
        line = f"flew {mission:.1f} s in {wall:.1f} s, {factor}; ready after {start:.1f} s"
        Console(highlight=False, soft_wrap=True).print(line)


def show_left(recordings: Sequence[Path]) -> None:
    """Print the fate of drones that still fly when the application ends."""
    text = "a drone is still flying: it comes down by itself, and its processes end then"
    _warn(text, recordings)


def show_headless(head: str, recordings: Sequence[Path]) -> None:
    """Print the end of a run whose cluster has lost its head, at the address `head`."""
    text = (
        f"the cluster's head at {head} is out of reach: what runs here for this flight ends by "
        "itself within half a minute"
    )
    _warn(text, recordings)


def _warn(text: str, recordings: Sequence[Path]) -> None:
    places = ", ".join(_shown(path) for path in recordings)
    line = f"{text}; its recording: {places}" if places else text
    Console(highlight=False, soft_wrap=True, stderr=True).print(line, markup=False)


def show_results(
    options: RunOptions, recordings: Sequence[Path], *, source_recorded: bool = False
) -> None:
    """Write what `options` ask for of a closed recording; print the places of all files.

    Args:
        options: Those of the run.
        recordings: Files of the recording in their order, of which the report shows the first.
        source_recorded: Whether the recording holds the application's source.
    """
    if not recordings or options.report is None:
        return
    recording = recordings[0]
    from aerodaas.recording.report.report import (  # noqa: PLC0415 - matplotlib is slow to load
        write_report,
        write_summary,
    )

    console = Console(highlight=False, soft_wrap=True)
    places = [("recording", path) for path in recordings]
    try:
        if options.report == "figures":
            write_summary(recording, recording.parent)
            return
        report = write_report(recording, recording.parent)
    except RecordingError as error:
        console.print(f"no report: {error}", markup=False)
        _print_places(console, places)
        return
    if options.view:
        console.print(str(report.summary), markup=False)
    _print_places(console, [*places, ("report", report.page), ("summary", report.summary_text)])
    for other in recordings[1:]:
        console.print(
            f"the report shows {recording.name} only; write one of the rest with\n"
            f"  aerodaas report {_shown(other)} --out {_shown(other.with_suffix(''))}",
            markup=False,
        )
    if options.application is not None:
        said = (
            "recorded (recording.application_source)"
            if source_recorded
            else "not recorded but for its name and SHA-256; see recording.application_source"
        )
        console.print(f"{'source':>{_NAMES}}  {said}", markup=False)
    if not has_extra("plots"):
        console.print(f"{'plots':>{_NAMES}}  pip install 'aerodaas[plots]'", markup=False)


def _print_places(console: Console, places: Iterable[tuple[str, Path]]) -> None:
    for name, path in places:
        console.print(f"{name:>{_NAMES}}  {_shown(path)}", markup=False)


def _shown(path: Path) -> str:
    absolute = path.resolve()
    here = Path.cwd()
    return str(absolute.relative_to(here) if absolute.is_relative_to(here) else absolute)
