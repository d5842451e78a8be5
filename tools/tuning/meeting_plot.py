"""Picture of a meeting: ways from above, and distances over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tools.tuning.meetings import CONTACT

__all__ = ["plot_meeting"]

_BEFORE, _AFTER = 2.0, 4.0
"""Seconds before and after the turn that are drawn."""
_EACH = 0.5
"""Seconds between two marks on a way."""
_COLOURS = ("tab:red", "tab:blue")


def plot_meeting(
    ways: Mapping[str, tuple[float, NDArray[np.float64]]], title: str, to: Path
) -> None:
    """Draw flights by name to the file `to`.

    Each is the second at which somebody turns, and the rows of `Nearest.path`.
    """
    figure = Figure(figsize=(10, 6), layout="constrained")
    figure.suptitle(title)
    above = figure.subplot_mosaic([[*ways], ["distance"] * len(ways)])
    for (name, (turn, flown)), colour in zip(ways.items(), _COLOURS, strict=True):
        time = flown[:, 0] - turn
        kept = (time >= -_BEFORE) & (time <= _AFTER)
        time, rows = time[kept], flown[kept]
        axes = above[name]
        marked = np.flatnonzero(np.abs(time / _EACH - np.round(time / _EACH)) < 1e-6)  # noqa: PLR2004 - rounding
        axes.plot(rows[:, 1], rows[:, 2], color=colour, label="drone")
        axes.plot(rows[:, 3], rows[:, 4], color="tab:gray", label="person")
        axes.plot(rows[marked, 1], rows[marked, 2], ".", color=colour)
        axes.plot(rows[marked, 3], rows[marked, 4], ".", color="tab:gray")
        nearest = int(rows[:, 5].argmin())
        axes.plot(rows[nearest, [1, 3]], rows[nearest, [2, 4]], "k--", linewidth=1)
        axes.set(title=f"{name}: {rows[nearest, 5]:.2f} m", xlabel="east, m", ylabel="north, m")
        axes.set_ylim(-2.0, 2.0)
        axes.legend(loc="upper left", fontsize="small")
        above["distance"].plot(time, rows[:, 5], color=colour, label=name)
    axes = above["distance"]
    axes.axhline(CONTACT, color="black", linestyle=":", label="contact")
    axes.axvline(0.0, color="tab:gray", linewidth=0.8)
    axes.set(xlabel="seconds from the turn", ylabel="distance, m", ylim=(0.0, None))
    axes.legend(loc="lower right", fontsize="small")
    to.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(to, dpi=110)
