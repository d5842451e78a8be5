"""Plots of the lab: bars per scheduler, and the timeline of one edge."""

from __future__ import annotations

from collections.abc import Mapping
from heapq import heappop, heappush
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from aerodaas.schedulers.analytics.base import Result, TaskOutcome, TaskPlace
from aerodaas.schedulers.lab.run import LabResult
from aerodaas.schedulers.lab.simulator import Trace

__all__ = ["plot_bars", "plot_timeline"]

PALETTE = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")
"""Okabe and Ito (2008): distinguishable with every kind of colour vision."""
_STYLE: dict[str, Any] = {
    "figure.dpi": 120,
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


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
    with plt.style.context(_STYLE):
        fig, axes = plt.subplots(1, 3, figsize=(11, 0.9 + 0.32 * len(names)), sharey=True)
        for axis, (key, label), colour in zip(axes, panels.items(), PALETTE, strict=False):
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
        fig.savefig(path)
        plt.close(fig)


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
    colours = dict(zip(models, PALETTE, strict=False))
    cloud = _rows([r for r in shown if r.place is TaskPlace.CLOUD])
    height = max((row for _, row in cloud), default=0) + 1
    with plt.style.context(_STYLE):
        fig, axis = plt.subplots(figsize=(11, 1.8 + 0.14 * height))
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
        fig.savefig(path)
        plt.close(fig)


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
