"""Plots of the lab: bars per scheduler, the timeline of one edge, and sweeps for papers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from heapq import heappop, heappush
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from aerodaas.schedulers.analytics.base import Result, TaskOutcome, TaskPlace
from aerodaas.schedulers.lab.run import LabResult
from aerodaas.schedulers.lab.simulator import Trace
from aerodaas.schedulers.lab.sweep import Row, SweepResult

__all__ = ["plot_bars", "plot_sweep", "plot_timeline"]

_PALETTE = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")
"""Okabe and Ito (2008): distinguishable with every kind of colour vision."""
_STYLE: dict[Any, Any] = {
    "figure.dpi": 120,
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


_LABELS = {
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
_PAPER: dict[Any, Any] = {
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


@contextmanager
def _drawn(path: Path, style: dict[Any, Any], width: float, height: float) -> Iterator[Figure]:
    """Yield a figure of this size in inches, and save what was drawn."""
    with mpl.rc_context(style):
        figure = Figure(figsize=(width, height))
        yield figure
        figure.savefig(path)


def plot_bars(result: LabResult, path: Path) -> None:
    """Utility (with the clairvoyant bound), completion and QoE per scheduler, with intervals.

    Args:
        result: The schedulers' scores, and the bounds if there are any.
        path: File of the picture.
    """
    names = list(result.scores)
    figures = {name: result.figures(name) for name in names}
    panels = {
        "qos per s": "QoS utility per s",
        "completion": "completed in time (%)",
        "qoe per s": "QoE utility per s",
    }
    with _drawn(path, _STYLE, 11, 0.9 + 0.32 * len(names)) as fig:
        axes = fig.subplots(1, 3, sharey=True)
        for axis, (key, label), colour in zip(axes, panels.items(), _PALETTE, strict=False):
            scale = 100 if key == "completion" else 1
            values = [figures[name][key].value * scale for name in names]
            margins = [figures[name][key].margin * scale for name in names]
            axis.barh(names, values, xerr=margins, color=colour, height=0.7, capsize=2)
            axis.set_xlabel(label)
            axis.bar_label(
                axis.containers[-1],
                fmt="%.4g",
                padding=6,
                fontsize=8,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
            )
            axis.margins(x=0.2)
        if result.bounds:
            bound = sum(result.bounds) / len(result.bounds) / (result.workload.duration / 1e9)
            axes[0].axvline(bound, color="black", linestyle="--", linewidth=1)
            axes[0].annotate(
                "clairvoyant bound",
                (bound, 1.0),
                xycoords=("data", "axes fraction"),
                ha="right",
                va="bottom",
                fontsize=8,
            )
        axes[0].invert_yaxis()
        fig.suptitle(
            f"{result.workload.name}, {result.network.name} network, {result.times.name} times, "
            f"{len(result.seeds)} seeds (95 % intervals)",
            fontsize=10,
        )
        fig.tight_layout()


def plot_timeline(trace: Trace, path: Path, title: str, begin: float, end: float) -> None:
    """Executions on one edge, by model; misses are hatched.

    Args:
        trace: The edge's run.
        path: File of the picture.
        title: Title of the picture.
        begin: Begin of the time shown, seconds.
        end: End of the time shown, seconds.
    """
    shown = [r for r in trace.results if r.finished / 1e9 >= begin and r.started / 1e9 <= end]
    models = sorted({result.task.profile.model for result in trace.results})
    colours = dict(zip(models, _PALETTE, strict=False))
    cloud = _rows([r for r in shown if r.place is TaskPlace.CLOUD])
    height = max((row for _, row in cloud), default=0) + 1
    with _drawn(path, _STYLE, 11, 1.8 + 0.14 * height) as fig:
        axis = fig.subplots()
        for result in shown:
            if result.place is TaskPlace.EDGE:
                _bar(axis, result, -2.2, 1.8, colours)
        for result, row in cloud:
            _bar(axis, result, row, 0.85, colours)
        for result in shown:
            if result.place is TaskPlace.NOWHERE:
                colour = colours[result.task.profile.model]
                axis.plot(result.finished / 1e9, -3.2, "x", color=colour, markersize=6)
        axis.set_yticks([-3.2, -1.3, height / 2], ["dropped", "edge", "cloud"])
        axis.set_xlim(begin, end)
        axis.set_ylim(-4, height + 0.5)
        axis.set_xlabel("seconds")
        handles = [Patch(color=colours[model], label=model) for model in models]
        handles.append(Patch(facecolor="white", edgecolor="black", hatch="////", label="too late"))
        axis.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        axis.set_title(title, fontsize=10)
        fig.tight_layout()


def _bar(axis: Axes, result: Result, row: float, height: float, colours: Mapping[str, str]) -> None:
    axis.barh(
        row,
        (result.finished - result.started) / 1e9,
        height,
        result.started / 1e9,
        align="edge",
        color=colours[result.task.profile.model],
        edgecolor="white" if result.outcome is TaskOutcome.DONE else "black",
        linewidth=0.5,
        hatch=None if result.outcome is TaskOutcome.DONE else "////",
    )


def _rows(results: list[Result]) -> list[tuple[Result, int]]:
    """Give executions that overlap different rows, the lowest that is free."""
    free: list[int] = []
    busy: list[tuple[int, int]] = []
    placed: list[tuple[Result, int]] = []
    rows = 0
    for result in sorted(results, key=lambda r: r.started):
        while busy and busy[0][0] <= result.started:
            heappush(free, heappop(busy)[1])
        if free:
            row = heappop(free)
        else:
            row, rows = rows, rows + 1
        heappush(busy, (result.finished, row))
        placed.append((result, row))
    return placed


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
    with _drawn(path, _PAPER, _COLUMN * columns, 2.3 * lines + 0.3) as fig:
        grid = fig.subplots(lines, columns, sharey=True, squeeze=False)
        axes = list(grid.flat)
        for axis, panel in zip(axes, panels, strict=False):
            shown = [row for row in rows if tuple(row[name] for name in others) == panel]
            _draw(axis, result, over, shown, _LABELS[figure][1])
            axis.set_title(
                ", ".join(f"{name} {value}" for name, value in zip(others, panel, strict=True)),
                fontsize=8,
            )
        for axis in axes[len(panels) :]:
            axis.set_axis_off()
        for line in grid:
            line[0].set_ylabel(_LABELS[figure][0])
        handles, names = axes[0].get_legend_handles_labels()
        below = min(4, len(names))
        fig.tight_layout(rect=(0, 0.09 / lines, 1, 1))
        fig.legend(handles, names, loc="lower center", ncols=below, fontsize=8)


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
        colour = _PALETTE[number % len(_PALETTE)]
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
