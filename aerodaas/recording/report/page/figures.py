"""Plots of a flight as PNG."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO

from matplotlib.figure import Figure

from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.plot import Plot
from aerodaas.recording.report.plots.latency import latency_figure
from aerodaas.recording.report.plots.loads import loads_figure
from aerodaas.recording.report.plots.outcomes import outcomes_figure
from aerodaas.recording.report.plots.timeline import timeline_figure
from aerodaas.recording.report.plots.trajectory import profile_figure, trajectory_figure

__all__ = ["plots_of"]

_DPI = 200


def plots_of(flight: RecordedFlight) -> list[Plot]:
    """All plots that the flight has data for, the most important first."""
    flown = any(robot.states for robot in flight.robots.values())
    makers: list[tuple[str, str, str, Callable[[RecordedFlight], Figure], bool]] = [
        (
            "trajectory",
            "Seen from above",
            "Path over the ground in the colours of the mission's states, with waypoints",
            trajectory_figure,
            flown,
        ),
        (
            "profile",
            "Seen from the side",
            "Height over the way flown in the colours of the mission's states",
            profile_figure,
            flown,
        ),
        (
            "timeline",
            "Height and battery over time",
            "Height and battery charge over mission time",
            timeline_figure,
            flown,
        ),
        (
            "latency",
            "Latency",
            "Violins of the time taken on each hop, end to end, and of the overhead",
            latency_figure,
            bool(flight.latencies),
        ),
        (
            "outcomes",
            "Analytics scheduling",
            "Bars of what the scheduler decided and what came of it, by analysis",
            outcomes_figure,
            bool(flight.outcomes),
        ),
        (
            "load",
            "Processor and memory",
            "Processor and memory of each actor over mission time",
            loads_figure,
            bool(flight.loads),
        ),
    ]
    return [
        Plot(name, title, description, _png(make(flight)))
        for name, title, description, make, wanted in makers
        if wanted
    ]


def _png(figure: Figure) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, dpi=_DPI)
    return buffer.getvalue()
