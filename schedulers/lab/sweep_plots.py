"""Plots of a sweep as a paper prints them: one panel for each case of the other parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from aerodaas.schedulers.lab.plots import PALETTE
from aerodaas.schedulers.lab.sweep import Row, SweepResult

__all__ = ["LABELS", "plot_sweep"]

LABELS = {
    "completion": ("completed in time (%)", 100),
    "qos per s": ("QoS utility per s", 1),
    "qoe per s": ("QoE utility per s", 1),
    "late": ("late (%)", 100),
    "dropped": ("dropped (%)", 100),
    "migrated": ("migrated (%)", 100),
    "stolen": ("stolen (%)", 100),
    "edge use": ("use of the edge (%)", 100),
    "cloud use": ("executions in the cloud at once", 1),
    "cost per s": ("cost per s", 1),
    "of bound": ("of the clairvoyant bound (%)", 100),
}
"""Words for an axis by figure, and what its values are multiplied by."""
_STYLE: dict[str, Any] = {
    "font.family": "serif",
    "font.size": 8,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.linewidth": 0.3,
    "grid.color": "0.8",
    "lines.linewidth": 1.0,
    "lines.markersize": 4,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "legend.frameon": False,
    "pdf.fonttype": 42,  # what conferences' checkers ask for
    "savefig.dpi": 200,
}
_MARKERS = "osD^vPX*"
_COLUMN = 3.4
"""Inches: a column of a paper of two."""
_PER_ROW = 3


def plot_sweep(result: SweepResult, figure: str, path: Path) -> None:
    """Plot means with 95 % intervals over the parameter with the most numbers.

    Lines where its values are numbers, bars where they are words; one panel for each combination of
    the other parameters.

    Args:
        result: Of `run_sweep`.
        figure: One of `result.figures`.
        path: File; its suffix says the format, such as `.pdf` or `.png`.
    """
    rows = result.summary(figure)
    over = max(result.parameters, key=lambda name: _numbers(rows, name))
    others = [name for name in result.parameters if name != over]
    panels = list(dict.fromkeys(tuple(row[name] for name in others) for row in rows))
    columns = min(len(panels), _PER_ROW)
    lines = -(-len(panels) // columns)
    size = (_COLUMN * columns, 2.3 * lines + 0.3)
    with plt.style.context(_STYLE):
        fig, grid = plt.subplots(lines, columns, figsize=size, sharey=True, squeeze=False)
        axes = list(grid.flat)
        for axis, panel in zip(axes, panels, strict=False):
            shown = [row for row in rows if tuple(row[name] for name in others) == panel]
            _draw(axis, result, over, shown, LABELS[figure][1])
            axis.set_title(
                ", ".join(f"{name} {value}" for name, value in zip(others, panel, strict=True)),
                fontsize=8,
            )
        for axis in axes[len(panels) :]:
            axis.set_axis_off()
        for line in grid:
            line[0].set_ylabel(LABELS[figure][0])
        handles, names = axes[0].get_legend_handles_labels()
        below = min(4, len(names))
        fig.tight_layout(rect=(0, 0.09 / lines, 1, 1))
        fig.legend(handles, names, loc="lower center", ncols=below, fontsize=8)
        fig.savefig(path)
        plt.close(fig)


def _numbers(rows: list[Row], name: str) -> int:
    """How many different numbers a parameter has; 0 for words."""
    values = {row[name] for row in rows}
    return 0 if any(isinstance(value, str) for value in values) else len(values)


def _draw(axis: Axes, result: SweepResult, over: str, rows: list[Row], scale: float) -> None:
    places = list(dict.fromkeys(row[over] for row in rows))
    numeric = not any(isinstance(place, str) for place in places)
    width = 0.8 / len(result.schedulers)
    for number, name in enumerate(result.schedulers):
        own = [row for row in rows if row["scheduler"] == name]
        means = [row["mean"] * scale for row in own]
        margins = [(row["high"] - row["mean"]) * scale for row in own]
        colour = PALETTE[number % len(PALETTE)]
        label = name.rpartition(":")[2]
        if numeric:
            marker = _MARKERS[number % len(_MARKERS)]
            at = [row[over] for row in own]
            axis.errorbar(
                at, means, yerr=margins, marker=marker, color=colour, label=label, capsize=2
            )
        else:
            offset = (number - (len(result.schedulers) - 1) / 2) * width
            at = [place + offset for place in range(len(places))]
            axis.bar(at, means, width, yerr=margins, color=colour, label=label, capsize=2)
    axis.set_xlabel(over)
    if numeric:
        axis.set_xticks(places)
    else:
        axis.set_xticks(range(len(places)), [str(place) for place in places])
