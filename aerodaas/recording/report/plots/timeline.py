"""Plot of height and battery over mission time, shaded by mission state."""

from __future__ import annotations

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.palette import OKABE_ITO
from aerodaas.recording.report.plots.style import (
    grid,
    legend,
    name_states,
    new_figure,
    shade_states,
    words,
)

__all__ = ["timeline_figure"]


def timeline_figure(flight: RecordedFlight) -> Figure:
    """Height and battery over mission time, shaded by mission state; two rows per robot."""
    robots = {name: robot for name, robot in flight.robots.items() if robot.states}
    rows = max(1, len(robots))
    figure = new_figure(1.0 + 3.0 * rows)
    both = figure.subplots(2 * rows, 1, sharex=True, squeeze=False)[:, 0]
    handles: dict[str, Artist] = {}
    for (name, robot), height, charge in zip(robots.items(), both[::2], both[1::2], strict=False):
        suffix = f" of {name}" if rows > 1 else ""
        height.plot(robot.time, robot.position[:, 2], color=OKABE_ITO["blue"], linewidth=1.8)
        height.set_ylabel(f"Height{suffix}\nabove home (m)")
        charge.plot(robot.time, 100 * robot.battery, color=OKABE_ITO["vermilion"], linewidth=1.8)
        charge.set_ylabel(f"Battery{suffix} (%)")
        charge.set_ylim(0, 103)
        height.margins(x=0, y=0.15)
        for axes in (height, charge):
            grid(axes, "y")
            handles |= {str(one.get_label()): one for one in shade_states(axes, robot)}
        name_states(height, robot)
        _mark_alerts(height, flight)
    both[-1].set_xlabel("Mission time (s)")
    legend(figure, list(handles.values()))
    return figure


def _mark_alerts(axes: Axes, flight: RecordedFlight) -> None:
    """Mark the first alert of each kind; a monitor may repeat itself hundreds of times."""
    first: dict[str, float] = {}
    for time, kind, _ in flight.alerts:
        first.setdefault(kind, time)
    for row, (kind, time) in enumerate(first.items()):
        axes.axvline(time, color="black", linestyle=":", linewidth=1)
        axes.text(
            time,
            0.5 - 0.1 * (row % 4),
            f" {words(kind)}",
            transform=axes.get_xaxis_transform(),
            fontsize=9,
        )
