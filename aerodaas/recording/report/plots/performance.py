"""Plots of latencies, loads of processes and machines, and outcomes of tasks."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.overlay import OKABE_ITO
from aerodaas.recording.report.plots.style import (
    CYCLE,
    grid,
    legend,
    log_milliseconds,
    new_figure,
    words,
)

__all__ = ["latency_figure", "loads_figure", "outcomes_figure"]

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
_MOST_LINES = 10
_LOOKS = {
    "edge": ("blue", ""),
    "cloud": ("sky", "//"),
    "drop": ("vermilion", "xx"),
    "done": ("green", ""),
    "late": ("orange", "\\\\"),
    "failed": ("black", ""),
    "timeout": ("purple", ".."),
    "dropped": ("vermilion", ".."),
    "retry": ("yellow", ""),
}
"""Colour and hatching of each action; the hatching distinguishes them in black and white."""
_DECISIONS = frozenset({"edge", "cloud", "drop", "retry"})
_LEAST_SHARE = 0.08


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


def loads_figure(flight: RecordedFlight) -> Figure:
    """Cores and memory of the ten busiest actors over mission time, with machines and GPUs."""
    figure = new_figure(4.6)
    cores, memory = figure.subplots(2, 1, sharex=True)
    busiest = sorted(flight.loads, key=lambda name: -sum(flight.loads[name].cpu))[:_MOST_LINES]
    lines: list[Artist] = []
    for name, (colour, style) in zip(busiest, CYCLE, strict=False):
        load = flight.loads[name]
        (line,) = cores.plot(load.time, load.cpu, style, color=colour, label=name)
        memory.plot(load.time, load.memory, style, color=colour)
        lines.append(line)
    share = cores.twinx()
    for number, (name, machine) in enumerate(flight.machines.items()):
        label = f"machine {name}" if len(flight.machines) > 1 else "whole machine"
        (line,) = share.plot(
            machine.time,
            [100 * cpu for cpu in machine.cpu],
            color=OKABE_ITO["grey"],
            linestyle=("-", "--", ":")[number % 3],
            linewidth=1.2,
            label=f"{label} (right)",
        )
        lines.append(line)
    for number, (name, gpu) in enumerate(flight.gpus.items()):
        (line,) = share.plot(
            gpu.time,
            [100 * busy for busy in gpu.cpu],
            color="black",
            linestyle=("-.", ":", "--")[number % 3],
            linewidth=1.2,
            label=f"GPU {name if len(flight.machines) > 1 else name.rpartition(' ')[2]} (right)",
        )
        lines.append(line)
    share.set(ylim=(0, 105), ylabel="Whole machine (%)")
    share.set_zorder(cores.get_zorder() - 1)
    cores.patch.set_visible(False)
    cores.set(ylabel="Processor (cores)")
    memory.set(ylabel="Memory (MB)", xlabel="Mission time (s)")
    for axes in (cores, memory):
        # From zero, with room above a line that hardly changes.
        axes.set_ylim(0, 1.1 * axes.get_ylim()[1])
        grid(axes, "y")
    legend(figure, lines)
    return figure


def outcomes_figure(flight: RecordedFlight) -> Figure:
    """For each analysis a bar of decisions and a bar of outcomes, counted in tasks."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for outcome in flight.outcomes:
        counts[outcome.analysis][outcome.action] += 1
    figure = new_figure(1.4 + 1.0 * len(counts))
    axes = figure.add_subplot()
    labels = []
    for row, (analysis, actions) in enumerate(counts.items()):
        decided = {name: n for name, n in actions.items() if name in _DECISIONS}
        became = {name: n for name, n in actions.items() if name not in _DECISIONS}
        _bar(axes, 2 * row, decided)
        _bar(axes, 2 * row + 1, became)
        labels += [f"{analysis.rsplit('/', 1)[-1]}: decided", "came of it"]
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()
    axes.set_xlabel("Tasks")
    grid(axes, "x")
    met = dict.fromkeys(name for actions in counts.values() for name in actions)
    legend(
        figure,
        [
            Patch(facecolor=colour, edgecolor="white", hatch=hatch, label=words(name))
            for name in met
            for colour, hatch in [_line_style(name)]
        ],
        columns=4,
    )
    return figure


def _bar(axes: Axes, row: int, counts: dict[str, int]) -> None:
    left, whole = 0, sum(counts.values())
    for name in sorted(counts, key=lambda one: list(_LOOKS).index(one) if one in _LOOKS else 99):
        count = counts[name]
        colour, hatch = _line_style(name)
        axes.barh(row, count, left=left, color=colour, hatch=hatch, edgecolor="white", height=0.75)
        if count >= _LEAST_SHARE * whole:
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
            axes.text(left + count / 2, row, str(count), ha="center", va="center", bbox=box)
        left += count


def _line_style(name: str) -> tuple[str, str]:
    colour, hatch = _LOOKS.get(name, ("grey", "++"))
    return OKABE_ITO[colour], hatch
