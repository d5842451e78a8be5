"""Plot of the analytics scheduler's decisions and the tasks' outcomes."""

from __future__ import annotations

from collections import Counter, defaultdict

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.palette import OKABE_ITO
from aerodaas.recording.report.plots.style import grid, legend, new_figure, words

__all__ = ["outcomes_figure"]

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
            for colour, hatch in [_look(name)]
        ],
        columns=4,
    )
    return figure


def _bar(axes: Axes, row: int, counts: dict[str, int]) -> None:
    left, whole = 0, sum(counts.values())
    for name in sorted(counts, key=lambda one: list(_LOOKS).index(one) if one in _LOOKS else 99):
        count = counts[name]
        colour, hatch = _look(name)
        axes.barh(row, count, left=left, color=colour, hatch=hatch, edgecolor="white", height=0.75)
        if count >= _LEAST_SHARE * whole:
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
            axes.text(left + count / 2, row, str(count), ha="center", va="center", bbox=box)
        left += count


def _look(name: str) -> tuple[str, str]:
    colour, hatch = _LOOKS.get(name, ("grey", "++"))
    return OKABE_ITO[colour], hatch
