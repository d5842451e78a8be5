"""Violin plot of latencies: to each actor, in it, since capture, and overhead."""

from __future__ import annotations

from typing import cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.palette import OKABE_ITO
from aerodaas.recording.report.plots.style import grid, legend, log_milliseconds, new_figure

__all__ = ["latency_figure"]

_SMALLEST_MS = 0.001
_TELLING = 0.01
"""Milliseconds below which a figure is written as an upper bound only."""
_MOST = 50_000
"""Most values that a violin is drawn from: more make no visible difference."""
_COLOURS = {"wait": "sky", "work": "blue", "total": "orange", "overhead": "yellow"}
_MEANINGS = {
    "wait": "on the way to an actor",
    "work": "in an actor",
    "total": "since capture",
    "overhead": "of that, without the work",
}

Floats = NDArray[np.float64]


def latency_figure(flight: RecordedFlight) -> Figure:
    """One violin per row on a logarithmic scale, with median and 99th percentile as text."""
    rows = _rows(flight)
    figure = new_figure(1.5 + 0.4 * len(rows))
    axes = figure.add_subplot()
    highest = -np.inf
    for place, (_, kind, values) in enumerate(rows):
        logs = np.log10(np.maximum(values, _SMALLEST_MS))
        parts = axes.violinplot(
            logs[:: len(logs) // _MOST + 1],
            positions=[place],
            widths=0.85,
            showextrema=False,
            orientation="horizontal",
        )
        for body in cast("list[Artist]", parts["bodies"]):
            body.set(
                facecolor=OKABE_ITO[_COLOURS[kind]], edgecolor="black", alpha=0.8, linewidth=0.5
            )
        median = float(np.log10(max(float(np.median(values)), _SMALLEST_MS)))
        axes.plot([median, median], [place - 0.25, place + 0.25], "k-")
        highest = max(highest, float(logs.max()))
    low, _ = axes.get_xlim()
    for place, (_, _, values) in enumerate(rows):
        median, late = np.percentile(values, [50, 99])
        axes.text(highest, place, f"   {_short(median)} ({_short(late)})", va="center", fontsize=9)
    # Room for the figures at the right.
    axes.set_xlim(low, highest + 0.62 * (highest - low) + 0.1)
    axes.set_yticks(range(len(rows)), [label for label, _, _ in rows], fontsize=9)
    axes.invert_yaxis()
    axes.set_xlabel("Milliseconds; median (99th percentile)")
    log_milliseconds(axes)
    grid(axes, "x")
    kinds = dict.fromkeys(kind for _, kind, _ in rows)
    legend(
        figure,
        [Patch(color=OKABE_ITO[_COLOURS[kind]], label=_MEANINGS[kind]) for kind in kinds],
    )
    return figure


def _rows(flight: RecordedFlight) -> list[tuple[str, str, Floats]]:
    """Label, kind and milliseconds of each row, in the order of the data's path."""
    longest = max(flight.latencies.values(), key=lambda latency: len(latency.work), default=None)
    nodes = dict.fromkeys(
        node
        for latency in ([longest] if longest else []) + [*flight.latencies.values()]
        for node in latency.work
    )
    rows = []
    for node in nodes:
        best = max(flight.latencies.values(), key=lambda latency: len(latency.work.get(node, ())))
        short = node.rsplit("/", 1)[-1]
        if any(best.wait[node]):
            rows.append((f"to {short}", "wait", np.array(best.wait[node])))
        rows.append((short, "work", np.array(best.work[node])))
    for stream, latency in flight.latencies.items():
        short = stream.rsplit("/", 1)[-1]
        rows.append((f"capture to {short}", "total", np.array(latency.total)))
        rows.append(("of that, overhead", "overhead", np.array(latency.overhead)))
    return rows


def _short(milliseconds: float) -> str:
    return f"{milliseconds:.3g}" if milliseconds >= _TELLING else f"<{_TELLING}"
