"""Plots of the flight from above and over mission time."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight
from aerodaas.recording.report.overlay import OKABE_ITO, STATE_COLOURS, label_colour
from aerodaas.recording.report.plots.style import (
    colours_of,
    grid,
    legend,
    mark,
    name_states,
    new_figure,
    shade_states,
    words,
)

__all__ = ["timeline_figure", "trajectory_figure"]

_STAYING = 0.6
"""Metres within which a drone counts as stationary …"""
_LONG = 1.5
"""… if it stays so for this many seconds."""
_GROUND = frozenset({"idle", "preflight", "taking_off", "landing", "landed", "aborted"})
_SHAPES = "sDv^P*X"
"""Marks of the first, second, … label seen."""
_NAMES = 8
"""Waypoints that are named at most: more names would hide each other."""
_APART = 1.0
"""Metres between the marks of one label: an object seen 15 times a second is marked once."""

Floats = NDArray[np.float64]


def timeline_figure(flight: RecordedFlight) -> Figure:
    """Height and battery over mission time, shaded by mission state; two rows per robot."""
    robots = {name: robot for name, robot in flight.robots.items() if robot.states}
    rows = max(1, len(robots))
    figure = new_figure(1.0 + 3.0 * rows)
    both = figure.subplots(2 * rows, 1, sharex=True, squeeze=False)[:, 0]
    handles: dict[str, Artist] = {}
    for (name, robot), height, charge in zip(robots.items(), both[::2], both[1::2], strict=False):
        suffix = f" of {name}" if rows > 1 else ""
        height.plot(robot.time, robot.position[:, 2], color=OKABE_ITO["blue"], linewidth=1.8)
        height.set_ylabel(f"Height{suffix}\nabove home (m)")
        charge.plot(robot.time, 100 * robot.battery, color=OKABE_ITO["vermilion"], linewidth=1.8)
        charge.set_ylabel(f"Battery{suffix} (%)")
        charge.set_ylim(0, 103)
        height.margins(x=0, y=0.15)
        for axes in (height, charge):
            grid(axes, "y")
            handles |= {str(one.get_label()): one for one in shade_states(axes, robot)}
        name_states(height, robot)
        _mark_alerts(height, flight)
    both[-1].set_xlabel("Mission time (s)")
    legend(figure, list(handles.values()))
    return figure


def _mark_alerts(axes: Axes, flight: RecordedFlight) -> None:
    """Mark the first alert of each kind; a monitor may repeat itself hundreds of times."""
    first: dict[str, float] = {}
    for time, kind, _ in flight.alerts:
        first.setdefault(kind, time)
    for row, (kind, time) in enumerate(first.items()):
        axes.axvline(time, color="black", linestyle=":", linewidth=1)
        axes.text(
            time,
            0.5 - 0.1 * (row % 4),
            f" {words(kind)}",
            transform=axes.get_xaxis_transform(),
            fontsize=9,
        )


def trajectory_figure(
    flight: RecordedFlight, overlay: Callable[[Axes], list[Artist]] | None = None
) -> Figure:
    """The flight from above: path coloured by mission state, waypoints, take-off, geofence.

    A ring around a waypoint shows a state in which the drone stayed there. Small marks on the path
    show the drone's positions at detections.

    Args:
        flight: The flight.
        overlay: Draws more onto the axes, and returns its entries of the legend.
    """
    figure = new_figure(5.4)
    axes = figure.add_subplot()
    states: dict[str, None] = {}
    seen: list[Artist] = []
    for name, robot in flight.robots.items():
        _draw_plan(axes, robot)
        states |= dict.fromkeys(_draw_path(axes, robot))
        seen += _draw_sightings(axes, flight, name, robot)
        if len(robot.position):
            east, north, _ = robot.position[0]
            axes.plot(east, north, "^", color="black", markersize=17, mfc="none", zorder=5)
            label = f"take-off, {name}" if len(flight.robots) > 1 else "take-off"
            _label(axes, east, north, label, below=True)
    marks = _visited_mark(flight)
    if any(set(robot.plan) - set(robot.visited) for robot in flight.robots.values()):
        marks.append(mark("waypoint, not visited", "white"))
    if any(robot.fence for robot in flight.robots.values()):
        marks.append(Line2D([], [], linestyle="--", color="black", label="geofence"))
    if overlay is not None:
        marks += overlay(axes)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="East of home (m)", ylabel="North of home (m)")
    axes.margins(0.08)
    grid(axes)
    legend(figure, [*_state_lines(states), *marks, *seen])
    return figure


def _visited_mark(flight: RecordedFlight) -> list[Artist]:
    visited = any(robot.visited for robot in flight.robots.values())
    return [mark("waypoint, visited", "black")] if visited else []


def _state_lines(states: dict[str, None]) -> list[Artist]:
    return [
        Line2D([], [], color=colour, linewidth=4, label=names)
        for colour, names in colours_of(states)
    ]


def _pieces(robot: RobotFlight) -> Iterator[tuple[int, int, str]]:
    """Yield stretches of one state, each extended by a point so that the line has no gaps."""
    states = np.array(robot.state_at(robot.time))
    if not len(states):
        return
    cuts = np.flatnonzero(states[1:] != states[:-1]) + 1
    for begin, end in zip([0, *cuts], [*cuts, len(states)], strict=True):
        yield int(begin), int(end) + 1, str(states[begin])


def _draw_plan(axes: Axes, robot: RobotFlight) -> None:
    if robot.fence:
        ring = np.array([*robot.fence, robot.fence[0]])
        axes.plot(ring[:, 0], ring[:, 1], "--", color="black", linewidth=1.2)
    order = {name: str(number) for number, name in enumerate(robot.visited, start=1)}
    count = len(robot.plan)
    labelled = np.linspace(0, count - 1, min(count, _NAMES)).round().astype(int).tolist()
    for index, (name, (east, north, _)) in enumerate(robot.plan.items()):
        face = "black" if name in order else "white"
        axes.plot(east, north, "o", color="black", mfc=face, markersize=7, zorder=4)
        if index in labelled:
            _label(axes, east, north, f"{order[name]}. {name}" if name in order else name)


def _draw_path(axes: Axes, robot: RobotFlight) -> list[str]:
    """Draw the path and return its states."""
    met = []
    for begin, end, state in _pieces(robot):
        piece = robot.position[begin:end, :2]
        colour = STATE_COLOURS.get(state, "black")
        extent = float(np.ptp(piece, axis=0).max())
        met.append(state)
        long = robot.time[min(end, len(robot.time)) - 1] - robot.time[begin] >= _LONG
        if extent < _STAYING and long and state not in _GROUND:
            axes.plot(*piece.mean(axis=0), "o", color=colour, markersize=14, zorder=2)
            continue
        axes.plot(piece[:, 0], piece[:, 1], color=colour, linewidth=2.5, zorder=3)
        if extent > _STAYING:
            _arrow(axes, piece, colour)
    return met


def _draw_sightings(
    axes: Axes, flight: RecordedFlight, name: str, robot: RobotFlight
) -> list[Artist]:
    """Mark the drone's positions at detections; returns the legend entries."""
    if not len(robot.time):
        return []
    places: dict[str, list[Floats]] = {}
    for sighting in flight.sightings:
        if not sighting.source.startswith(f"{name}/"):
            continue
        index = int(np.searchsorted(robot.time, seconds(sighting.stamp)))
        place = robot.position[min(index, len(robot.position) - 1), :2]
        known = places.setdefault(sighting.label, [])
        if all(float(np.linalg.norm(place - other)) >= _APART for other in known):
            known.append(place)
    entries: list[Artist] = []
    for (label, spots), shape in zip(places.items(), _SHAPES, strict=False):
        points = np.array(spots)
        colour = label_colour(label)
        axes.plot(
            points[:, 0],
            points[:, 1],
            shape,
            color=colour,
            markeredgecolor="black",
            markersize=7,
            zorder=4,
        )
        entries.append(mark(f"drone saw: {label}", colour, shape))
    return entries


def _arrow(axes: Axes, piece: Floats, colour: str) -> None:
    """Draw an arrow head half-way along a path, by distance flown."""
    way = np.cumsum(np.linalg.norm(np.diff(piece, axis=0), axis=1))
    middle = int(np.searchsorted(way, way[-1] / 2))
    # Direction over a tenth of the path, so that position noise does not rotate the arrow.
    reach = max(1, len(piece) // 20)
    tail, head = piece[max(0, middle - reach)], piece[min(len(piece) - 1, middle + reach)]
    style = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 25, "linewidth": 0}
    axes.annotate("", head, tail, arrowprops=style, zorder=3)


def _label(axes: Axes, x: float, y: float, text: str, *, below: bool = False) -> None:
    axes.annotate(
        text,
        (x, y),
        xytext=(8, -14 if below else 7),
        textcoords="offset points",
        zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1},
        fontsize=10,
    )
