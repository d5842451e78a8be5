"""Before and after a search: distance and height over time, and the path on the ground."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from tools.tuning.search import FollowTask, Tuned

__all__ = ["plot_tuned"]

_BEFORE, _AFTER, _PERSON = "#8a8f98", "#0b6fb8", "#d9822b"


def plot_tuned(tuned: Tuned, task: FollowTask, path: Path) -> None:
    """Write a picture of all walks that judge to `path`, in the format of its suffix."""
    figure = Figure(figsize=(11, 2.9 * len(task.speeds)), layout="constrained")
    axes = figure.subplots(len(task.speeds), 3, squeeze=False, width_ratios=(3, 3, 2))
    for row, speed, old, new in zip(
        axes, task.speeds, tuned.flown_before, tuned.flown_after, strict=True
    ):
        far, high, ground = row
        for axis, name, wanted, tolerance in (
            (far, "distance", task.distance, 0.3),
            (high, "height", task.height, 0.1),
        ):
            axis.axhspan(wanted - tolerance, wanted + tolerance, color="#dcefe0", zorder=0)
            axis.plot(old.time, getattr(old, name), color=_BEFORE, lw=1.2, label="before")
            axis.plot(new.time, getattr(new, name), color=_AFTER, lw=1.4, label="after")
            axis.set(xlabel="mission time, s", ylabel=f"{name}, m")
            axis.margins(x=0)
        far.set_title(f"person at {speed:g} m/s", loc="left", fontsize=10)
        ground.plot(*new.person.T, color=_PERSON, lw=1.4, label="person")
        ground.plot(*old.place.T, color=_BEFORE, lw=1.0, label="before")
        ground.plot(*new.place.T, color=_AFTER, lw=1.2, label="after")
        ground.set(xlabel="east, m", ylabel="north, m", aspect="equal")
        ground.set_adjustable("datalim")
    axes[0][2].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=130)
