"""A flight's pictures: trajectory in plan, height and battery over time, latency of each hop.

Colours are Okabe and Ito's, and no picture is read by colour alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter
from numpy.typing import NDArray

from aerodaas.recording.flight import Flight, RobotFlight
from aerodaas.recording.palette import OKABE_ITO, STATE_COLOURS

__all__ = ["latency_figure", "timeline_figure", "trajectory_figure"]

_STAYING = 0.6
"""Metres within which a drone is taken to stay where it is."""
_GROUND = frozenset({"idle", "preflight", "taking_off", "landing", "landed", "aborted"})
_NARROW = 0.06
"""Share of the time axis below which a state's band is too narrow for its name."""
_SMALLEST_MS = 0.01
_DECADES = (1, 2, 5)


def trajectory_figure(flight: Flight, title: str) -> Figure:
    """The flight from above: path in the colours of its states, waypoints, take-off, fence.

    A ring around a waypoint shows a state in which the drone stayed there.
    """
    figure = Figure(figsize=(8, 7.5), layout="constrained")
    axes = figure.add_subplot()
    states: dict[str, None] = {}
    for name, robot in flight.robots.items():
        _draw_plan(axes, robot)
        states |= dict.fromkeys(_draw_path(axes, robot))
        if len(robot.position):
            east, north, _ = robot.position[0]
            axes.plot(east, north, "^", color="black", markersize=17, mfc="none", zorder=5)
            label = f"take-off, {name}" if len(flight.robots) > 1 else "take-off"
            _label(axes, east, north, label, below=True)
    lines: list[Artist] = [
        Line2D([], [], color=colour, linewidth=4, label=names)
        for colour, names in _by_colour(states)
    ]
    marks: list[Artist] = [
        _mark("waypoint, visited", "black"),
        _mark("waypoint, not visited", "white"),
    ]
    if any(robot.fence for robot in flight.robots.values()):
        marks.append(Line2D([], [], linestyle="--", color="black", label="geofence"))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="East of home (m)", ylabel="North of home (m)", title=title)
    axes.margins(0.08)
    axes.grid(visible=True, color="0.9")
    axes.set_axisbelow(True)
    figure.legend(handles=lines + marks, loc="outside lower center", ncols=3, frameon=False)
    return figure


def timeline_figure(flight: Flight, title: str) -> Figure:
    """Height and battery over mission time, above the states; two rows for each robot."""
    robots = {name: robot for name, robot in flight.robots.items() if robot.states}
    rows = max(1, len(robots))
    figure = Figure(figsize=(9, 1 + 3.6 * rows), layout="constrained")
    grid = figure.subplots(2 * rows, 1, sharex=True, squeeze=False)[:, 0]
    figure.suptitle(title)
    for (name, robot), height, charge in zip(robots.items(), grid[::2], grid[1::2], strict=False):
        suffix = f" of {name}" if rows > 1 else ""
        height.plot(robot.time, robot.position[:, 2], color=OKABE_ITO["blue"], linewidth=1.8)
        height.set_ylabel(f"Height{suffix}\nabove home (m)")
        charge.plot(robot.time, 100 * robot.battery, color=OKABE_ITO["vermilion"], linewidth=1.8)
        charge.set_ylabel(f"Battery{suffix} (%)")
        charge.set_ylim(0, 100)
        height.margins(x=0, y=0.15)
        for axes in (height, charge):
            axes.grid(visible=True, axis="y", color="0.9")
            _shade(axes, robot)
        _name_states(height, robot)
        _mark_alerts(height, flight)
    grid[-1].set_xlabel("Mission time (s)")
    states = dict.fromkeys(band.state for robot in robots.values() for band in robot.bands)
    handles = [Patch(color=c, alpha=0.35, label=names) for c, names in _by_colour(states)]
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def latency_figure(flight: Flight, title: str) -> Figure:
    """Violins of what each actor and each way between actors took, and of the whole."""
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.add_subplot()
    series = _latency_series(flight)
    colours = {"wait": "sky", "work": "blue", "total": "orange"}
    for place, (_, kind, values) in enumerate(series):
        logs = np.log10(np.maximum(values, _SMALLEST_MS))
        parts = axes.violinplot(logs, positions=[place], widths=0.85, showextrema=False)
        for body in cast("list[Artist]", parts["bodies"]):
            body.set(
                facecolor=OKABE_ITO[colours[kind]], edgecolor="black", alpha=0.8, linewidth=0.5
            )
        median, late = np.percentile(values, [50, 99])
        axes.plot([place - 0.2, place + 0.2], [np.log10(max(median, _SMALLEST_MS))] * 2, "k-")
        axes.annotate(
            f"{_short(median)}\n({_short(late)})",
            (place, logs.max()),
            xytext=(0, 4),
            textcoords="offset points",
            ha="center",
            fontsize=9,
        )
    _log_axis(axes)
    axes.set_xticks(range(len(series)), [label for label, _, _ in series])
    axes.tick_params(axis="x", labelrotation=20)
    axes.set(ylabel="Milliseconds (log scale)", title=f"{title}\nmedian (99th percentile)")
    axes.margins(y=0.15)
    axes.grid(visible=True, axis="y", color="0.9")
    axes.set_axisbelow(True)
    kinds = {"wait": "on the way to an actor", "work": "in an actor", "total": "since capture"}
    handles = [Patch(color=OKABE_ITO[colours[kind]], label=text) for kind, text in kinds.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _by_colour(states: Iterable[str]) -> list[tuple[str, str]]:
    """Each colour once, with the names of all states that it stands for."""
    names: dict[str, list[str]] = {}
    for state in states:
        names.setdefault(STATE_COLOURS.get(state, "black"), []).append(_words(state))
    return [(colour, " / ".join(group)) for colour, group in names.items()]


def _mark(label: str, face: str) -> Line2D:
    return Line2D([], [], linestyle="", marker="o", color="black", mfc=face, label=label)


def _draw_plan(axes: Axes, robot: RobotFlight) -> None:
    if robot.fence:
        ring = np.array([*robot.fence, robot.fence[0]])
        axes.plot(ring[:, 0], ring[:, 1], "--", color="black", linewidth=1.2)
    order = {name: str(number) for number, name in enumerate(robot.visited, start=1)}
    for name, (east, north, _) in robot.plan.items():
        face = "black" if name in order else "white"
        axes.plot(east, north, "o", color="black", mfc=face, markersize=7, zorder=4)
        _label(axes, east, north, f"{order[name]}. {name}" if name in order else name)


def _draw_path(axes: Axes, robot: RobotFlight) -> list[str]:
    """Draw the path and return the states met."""
    position, states = robot.position, np.array(robot.state_at(robot.time))
    if not len(position):
        return []
    cuts = np.flatnonzero(states[1:] != states[:-1]) + 1
    for begin, end in zip([0, *cuts], [*cuts, len(states)], strict=True):
        # One point further, so that the line has no gaps.
        piece = position[begin : end + 1, :2]
        colour = STATE_COLOURS.get(str(states[begin]), "black")
        extent = float(np.ptp(piece, axis=0).max())
        if extent < _STAYING and states[begin] not in _GROUND:
            axes.plot(*piece.mean(axis=0), "o", color=colour, markersize=14, zorder=2)
            continue
        axes.plot(piece[:, 0], piece[:, 1], color=colour, linewidth=2.5, zorder=3)
        if extent > _STAYING:
            _arrow(axes, piece, colour)
    return [str(state) for state in dict.fromkeys(states)]


def _arrow(axes: Axes, piece: NDArray[np.float64], colour: str) -> None:
    """An arrow head half-way along a path, by the way flown."""
    way = np.cumsum(np.linalg.norm(np.diff(piece, axis=0), axis=1))
    middle = int(np.searchsorted(way, way[-1] / 2))
    # Over a tenth of the way, so that noise of the position does not turn it.
    reach = max(1, len(piece) // 20)
    tail, head = piece[max(0, middle - reach)], piece[min(len(piece) - 1, middle + reach)]
    style = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 25, "linewidth": 0}
    axes.annotate("", head, tail, arrowprops=style, zorder=3)


def _label(axes: Axes, east: float, north: float, text: str, *, below: bool = False) -> None:
    axes.annotate(
        text,
        (east, north),
        xytext=(8, -14 if below else 7),
        textcoords="offset points",
        zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1},
        fontsize=10,
    )


def _shade(axes: Axes, robot: RobotFlight) -> None:
    for band in robot.bands:
        colour = STATE_COLOURS.get(band.state, "black")
        axes.axvspan(band.start, band.end, color=colour, alpha=0.25, linewidth=0)


def _name_states(axes: Axes, robot: RobotFlight) -> None:
    span = robot.time[-1] - robot.time[0]
    for band in robot.bands:
        if band.end - band.start < _NARROW * span:
            continue
        axes.text(
            (band.start + band.end) / 2,
            0.04,
            _words(band.state),
            transform=axes.get_xaxis_transform(),
            ha="center",
            fontsize=9,
        )


def _mark_alerts(axes: Axes, flight: Flight) -> None:
    """Mark the first alert of each kind; a monitor may repeat itself hundreds of times."""
    first: dict[str, float] = {}
    for time, kind, _ in flight.alerts:
        first.setdefault(kind, time)
    for kind, time in first.items():
        axes.axvline(time, color="black", linestyle=":", linewidth=1)
        axes.text(
            time,
            0.5,
            f" {_words(kind)}",
            transform=axes.get_xaxis_transform(),
            fontsize=9,
        )


def _latency_series(flight: Flight) -> list[tuple[str, str, NDArray[np.float64]]]:
    """Label, kind (`wait`, `work`, `total`) and milliseconds, in the order of the way."""
    longest = max(flight.latencies.values(), key=lambda latency: len(latency.work), default=None)
    nodes = dict.fromkeys(
        node
        for latency in ([longest] if longest else []) + [*flight.latencies.values()]
        for node in latency.work
    )
    series = []
    for node in nodes:
        best = max(flight.latencies.values(), key=lambda latency: len(latency.work.get(node, ())))
        short = node.rsplit("/", 1)[-1]
        series.append((f"to {short}", "wait", np.array(best.wait[node])))
        series.append((short, "work", np.array(best.work[node])))
    for stream, latency in flight.latencies.items():
        short = stream.rsplit("/", 1)[-1]
        series.append((f"capture to\n{short}", "total", np.array(latency.total)))
    return series


def _log_axis(axes: Axes) -> None:
    marks = [step * 10.0**decade for decade in range(-2, 6) for step in _DECADES]
    axes.yaxis.set_major_locator(FixedLocator([float(np.log10(mark)) for mark in marks]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{10**value:.3g}"))


def _short(milliseconds: float) -> str:
    return f"{milliseconds:.3g}"


def _words(state: str) -> str:
    return state.replace("_", " ")
