"""Shared style of the plots: size, type and legends readable on phone, paper and screen."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter

from aerodaas.recording.report.flight import RobotFlight
from aerodaas.recording.report.overlay import OKABE_ITO, STATE_COLOURS

__all__ = [
    "CYCLE",
    "WIDTH",
    "colours_of",
    "grid",
    "legend",
    "log_milliseconds",
    "mark",
    "name_states",
    "new_figure",
    "shade_states",
    "words",
]

WIDTH = 4.8
"""Width in inches; a phone shows less than four, at which 10 points stay readable."""

CYCLE: tuple[tuple[str, str], ...] = tuple(
    (OKABE_ITO[colour], line)
    for line in ("-", "--", ":")
    for colour in ("blue", "vermilion", "green", "orange", "purple", "sky", "black")
)
"""Colour and line style of the first, second, … line of a plot; no two alike."""

_HIGHEST = 100.0
"""Inches of the highest plot, which keeps it within the size of an image."""
_NARROW = 0.11
"""Fraction of the time axis below which a state's band is too narrow for its name."""
_DECADES = (1, 2, 5)


def new_figure(height: float) -> Figure:
    """A figure of the common width, `height` inches high."""
    return Figure(figsize=(WIDTH, min(height, _HIGHEST)), layout="constrained")


def grid(axes: Axes, axis: str = "both") -> None:
    """Draw light grid lines behind the data.

    Args:
        axes: Axes of the plot.
        axis: `x`, `y` or `both`.
    """
    axes.grid(visible=True, axis=axis, color="0.9")  # type: ignore[arg-type]
    axes.set_axisbelow(True)


def legend(figure: Figure, handles: list[Artist], columns: int = 2) -> None:
    """Add a legend below the plot.

    Args:
        figure: The plot; nothing is added without entries.
        handles: Entries of the legend.
        columns: Number of its columns.
    """
    if handles:
        figure.legend(
            handles=handles,
            loc="outside lower center",
            ncols=columns,
            frameon=False,
            fontsize=9,
            columnspacing=1.2,
        )


def words(name: str) -> str:
    """A name with blanks instead of underscores."""
    return name.replace("_", " ")


def colours_of(states: Iterable[str]) -> list[tuple[str, str]]:
    """Each colour once, with the names of all its states."""
    names: dict[str, list[str]] = {}
    for state in dict.fromkeys(states):
        names.setdefault(STATE_COLOURS.get(state, "black"), []).append(words(state))
    return [(colour, " / ".join(group)) for colour, group in names.items()]


def mark(label: str, face: str, shape: str = "o") -> Line2D:
    """A legend entry for a mark.

    Args:
        label: Its text.
        face: Colour of the mark's inside.
        shape: Matplotlib's letter of its shape.
    """
    return Line2D([], [], linestyle="", marker=shape, color="black", mfc=face, label=label)


def shade_states(axes: Axes, robot: RobotFlight) -> list[Artist]:
    """Colour the time axis by mission state.

    Args:
        axes: Axes of the plot.
        robot: Robot whose states are shown.

    Returns:
        Entries of the legend.
    """
    for band in robot.bands:
        colour = STATE_COLOURS.get(band.state, "black")
        axes.axvspan(band.start, band.end, color=colour, alpha=0.25, linewidth=0)
    return [
        Patch(color=colour, alpha=0.35, label=names)
        for colour, names in colours_of(band.state for band in robot.bands)
    ]


def name_states(axes: Axes, robot: RobotFlight) -> None:
    """Write the states' names into bands that are wide enough.

    Args:
        axes: Axes of the plot.
        robot: Robot whose states are shown.
    """
    span = robot.time[-1] - robot.time[0]
    for band in robot.bands:
        if band.end - band.start < _NARROW * span:
            continue
        axes.text(
            (band.start + band.end) / 2,
            0.04,
            words(band.state),
            transform=axes.get_xaxis_transform(),
            ha="center",
            fontsize=8,
        )


def log_milliseconds(axes: Axes) -> None:
    """Label an x axis of logarithms of milliseconds with the milliseconds."""
    low, high = axes.get_xlim()
    steps = _DECADES if high - low < len(_DECADES) else (1,)
    marks = [step * 10.0**decade for decade in range(-3, 6) for step in steps]
    axes.xaxis.set_major_locator(FixedLocator([float(np.log10(each)) for each in marks]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{10**value:g}"))
