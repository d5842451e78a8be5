"""Plots of a flight as PNG."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from io import BytesIO
from itertools import islice
from typing import TypeVar

import matplotlib as mpl
from matplotlib.figure import Figure

from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.plots.performance import (
    latency_figure,
    loads_figure,
    outcomes_figure,
)
from aerodaas.recording.report.plots.trajectory import timeline_figure, trajectory_figure
from aerodaas.recording.report.section import Drawing, Plot, ReportSection

__all__ = ["plots_of", "png_of"]

_DPI = 200
_MOST = 24
"""Robots, streams and analyses in one plot; more are too small to be told apart."""

V = TypeVar("V")


def plots_of(flight: RecordedFlight, sections: Sequence[ReportSection] = ()) -> list[Plot]:
    """All plots that there is data for, the most important first.

    Args:
        flight: The flight.
        sections: Sections of the report, whose plots follow.
    """
    shown = _shown(flight)
    drawings: list[Drawing] = []
    if any(robot.states for robot in flight.robots.values()):
        drawings += [
            Drawing(
                "trajectory",
                "Seen from above",
                "Path over the ground in the colours of the mission's states, with waypoints",
                partial(trajectory_figure, shown),
            ),
            Drawing(
                "timeline",
                "Height and battery over time",
                "Height and battery charge over mission time",
                partial(timeline_figure, shown),
            ),
        ]
    if flight.latencies:
        drawings.append(
            Drawing(
                "latency",
                "Latency",
                "Violins of the time taken on each hop, end to end, and of the overhead",
                partial(latency_figure, shown),
            )
        )
    if flight.outcomes:
        drawings.append(
            Drawing(
                "outcomes",
                "Analytics scheduling",
                "Bars of what the scheduler decided and what came of it, by analysis",
                partial(outcomes_figure, shown),
            )
        )
    if flight.loads:
        drawings.append(
            Drawing(
                "load",
                "Processor and memory",
                "Processor and memory of each actor over mission time",
                partial(loads_figure, shown),
            )
        )
    drawings += [drawing for section in sections for drawing in section.drawings]
    return [Plot(one.name, one.title, one.description, _png(one.draw)) for one in drawings]


def png_of(flight: RecordedFlight, make: Callable[[RecordedFlight], Figure]) -> bytes:
    """PNG of a plot of a flight.

    Args:
        flight: The flight.
        make: Draws the plot.
    """
    return _png(lambda: make(_shown(flight)))


def _png(make: Callable[[], Figure]) -> bytes:
    # Names in a recording may hold a `$`, which would begin a formula.
    with mpl.rc_context({"text.parse_math": False}):
        buffer = BytesIO()
        make().savefig(buffer, dpi=_DPI)
    return buffer.getvalue()


def _shown(flight: RecordedFlight) -> RecordedFlight:
    """The part of a flight that fits into its plots."""
    analyses = dict.fromkeys(outcome.analysis for outcome in flight.outcomes)
    kept = set(islice(analyses, _MOST))
    return replace(
        flight,
        robots=_first(flight.robots),
        latencies=_first(flight.latencies),
        machines=_first(flight.machines),
        gpus=_first(flight.gpus),
        outcomes=[outcome for outcome in flight.outcomes if outcome.analysis in kept],
    )


def _first(table: dict[str, V]) -> dict[str, V]:
    return dict(islice(table.items(), _MOST))
