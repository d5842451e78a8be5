"""The live view of a mission: a panel on a terminal, lines elsewhere."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.rule import Rule
from rich.text import Text
from typing_extensions import Self

from aerodaas.messages.mission import MissionState, RobotStatus
from aerodaas.terminal.lines import robot_line
from aerodaas.terminal.panels import alerts_panel, clock_text, robot_panel, streams_panel
from aerodaas.terminal.snapshot import Snapshot

__all__ = ["MissionView"]

_REDRAW = 0.1
_LINE_EVERY = 5.0
_WIDEST = 100
_LONGEST_PATH = 2000
_STEP = 0.1
"""Metres between the points of the drawn path."""


class MissionView:
    """View of a mission's snapshots; it may be updated often and redraws at a limited rate.

    On a terminal it draws a panel in place; into a pipe or a file it prints one line for each
    robot every few seconds and whenever a mission's state changes, unless it would be the same.
    Alerts are in the panel only: a pipe gets them on standard error, by whoever updates the view.
    """

    def __init__(self, console: Console | None = None) -> None:
        """Draw on `console`, or standard output."""
        self._console = console or Console(highlight=False)
        self._live: Live | None = None
        self._last: Snapshot | None = None
        self._drawn = -_LINE_EVERY
        self._lines: list[str] = []
        """What was told last of the robots."""
        self._states: dict[str, MissionState] = {}
        self._paths: dict[str, list[tuple[float, float]]] = {}

    def __enter__(self) -> Self:
        if self._console.is_terminal and not self._console.is_dumb_terminal:
            self._live = Live(console=self._console, auto_refresh=False)
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave the last view on the terminal."""
        if self._live is not None:
            if self._last is not None:
                self._live.update(self.render(self._last), refresh=True)
            self._live.stop()
            self._live = None
        elif self._last is not None:
            self._print(self._last)

    @property
    def live(self) -> bool:
        """Whether it redraws itself in place, as on a terminal."""
        return self._live is not None

    def update(self, snapshot: Snapshot) -> None:
        """Show `snapshot`."""
        self._last = snapshot
        for name, robot in snapshot.robots.items():
            self._remember(name, robot)
        now = time.monotonic()
        if self._live is not None:
            if now - self._drawn >= _REDRAW:
                self._drawn = now
                self._live.update(self.render(snapshot), refresh=True)
        else:
            states = {name: robot.mission.state for name, robot in snapshot.robots.items()}
            if states != self._states or now - self._drawn >= _LINE_EVERY:
                self._drawn = now
                self._states = states
                self._print(snapshot)

    def render(self, snapshot: Snapshot) -> Panel:
        """The view of a snapshot, at least 72 columns wide."""
        ascii_only = not self._console.encoding.lower().startswith("utf")
        parts = [
            robot_panel(name, robot, self._paths.get(name, ()), ascii_only=ascii_only)
            for name, robot in snapshot.robots.items()
        ]
        # rich draws a rule without a title in Unicode even where the terminal cannot.
        rule = Rule(style="dim", characters="-" if ascii_only else "─")
        if snapshot.streams:
            parts += [rule, streams_panel(snapshot.streams)]
        if snapshot.scheduler:
            parts += [rule, Text(snapshot.scheduler)]
        if snapshot.alerts:
            parts += [rule, alerts_panel(snapshot.alerts)]
        return Panel(
            Group(*parts),
            title=Text(snapshot.title, "bold"),
            title_align="left",
            subtitle=clock_text(snapshot),
            subtitle_align="right",
            width=min(self._console.width, _WIDEST),
        )

    def _remember(self, name: str, robot: RobotStatus) -> None:
        if robot.vehicle is None:
            return
        east, north, _ = (float(axis) for axis in robot.vehicle.odometry.position)
        path = self._paths.setdefault(name, [])
        if path and abs(path[-1][0] - east) + abs(path[-1][1] - north) < _STEP:
            return
        path.append((east, north))
        if len(path) > _LONGEST_PATH:
            del path[1::2]

    def _print(self, snapshot: Snapshot) -> None:
        lines = [robot_line(snapshot, *one) for one in snapshot.robots.items()]
        lines += [snapshot.scheduler] if snapshot.scheduler else []
        if lines != self._lines:
            self._lines = lines
            for line in lines:
                self._console.print(line, markup=False, soft_wrap=True)
