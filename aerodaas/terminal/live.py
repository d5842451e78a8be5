"""The live view of a mission: a panel on a terminal, lines elsewhere."""

from __future__ import annotations

import time

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.rule import Rule
from rich.text import Text
from typing_extensions import Self

from aerodaas.messages.mission import MissionState
from aerodaas.terminal.panels import (
    Snapshot,
    alerts_panel,
    clock_text,
    robot_line,
    robot_panel,
    streams_panel,
)

__all__ = ["FlightDisplay", "MissionView"]

_REDRAW = 0.1
_LINE_EVERY = 5.0
_WIDEST = 100


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

    def __enter__(self) -> Self:
        if self._console.is_terminal and not self._console.is_dumb_terminal:
            self._live = Live(console=self._console, auto_refresh=False)
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
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
        parts = [robot_panel(name, robot) for name, robot in snapshot.robots.items()]
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

    def _print(self, snapshot: Snapshot) -> None:
        lines = [robot_line(snapshot, *one) for one in snapshot.robots.items()]
        lines += [snapshot.scheduler] if snapshot.scheduler else []
        if lines != self._lines:
            self._lines = lines
            for line in lines:
                self._console.print(line, markup=False, soft_wrap=True)


class FlightDisplay:
    """Display of one flight: a view of it where one is wanted, and lines on standard error."""

    def __init__(self, *, shown: bool) -> None:
        self._view = MissionView() if shown else None
        self._errors = Console(stderr=True, highlight=False, soft_wrap=True)
        self._began = time.monotonic()

    def __enter__(self) -> Self:
        if self._view is not None:
            self._view.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        if self._view is not None:
            self._view.__exit__()

    @property
    def moves(self) -> bool:
        """Whether it is redrawn on a terminal, rather than printed line by line."""
        return self._view is not None and self._view.live

    def say(self, text: str) -> None:
        """Print a line on standard error."""
        self._errors.print(text, markup=False)
