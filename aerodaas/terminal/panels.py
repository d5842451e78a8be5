"""Parts of the terminal view: a mission at one moment, as text and as renderables of rich."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from aerodaas.messages.mission import BatteryOutlook, MissionState, MissionStatus, RobotStatus
from aerodaas.messages.vehicle import VehicleState

__all__ = [
    "Snapshot",
    "StreamSnapshot",
    "alerts_panel",
    "clock_text",
    "place_text",
    "robot_line",
    "robot_panel",
    "streams_panel",
    "waypoints_text",
]

_STYLES = {
    MissionState.ABORTED: "bold white on red",
    MissionState.DIVERTED: "bold black on yellow",
    MissionState.LANDED: "bold black on green",
    MissionState.RETURNING: "bold black on magenta",
}
_CHARGE_COLOURS = ((0.2, "red"), (0.4, "yellow"), (math.inf, "green"))
_BAR = 22
_ALERTS = 3


@dataclass(frozen=True, slots=True)
class StreamSnapshot:
    """One stream."""

    name: str
    rate: float | None = None
    """Items per mission second."""
    median_ms: float | None = None
    """From capture to publishing, milliseconds of the host's clock."""
    p99_ms: float | None = None
    drops: int = 0
    """Items that newer ones replaced before they were read."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole mission at one moment."""

    title: str
    mission_time: float
    """Mission seconds."""
    wall_time: float
    """Seconds on the host since the mission clock started."""
    robots: Mapping[str, RobotStatus] = field(default_factory=dict)
    """By id."""
    streams: tuple[StreamSnapshot, ...] = ()
    alerts: tuple[str, ...] = ()
    """One line each, newest last; the view shows the last few."""
    scheduler: str = ""
    """Figures of the analytics scheduler in one line; empty without one."""

    @property
    def factor(self) -> float:
        """Mission seconds per wall second."""
        return self.mission_time / self.wall_time if self.wall_time > 0 else 0.0


def clock_text(snapshot: Snapshot) -> str:
    """Mission time, its factor and wall time."""
    minutes, seconds = divmod(snapshot.mission_time, 60)
    return (
        f"mission {int(minutes)}:{seconds:04.1f}   {snapshot.factor:.1f}x real time   "
        f"wall {snapshot.wall_time:.0f} s"
    )


def place_text(vehicle: VehicleState) -> str:
    """East, north and up of home in metres."""
    # Adding zero turns -0.0 into 0.0.
    east, north, up = (round(float(axis), 1) + 0.0 for axis in vehicle.odometry.position)
    return f"E {east:.1f}  N {north:.1f}  up {up:.1f} m"


def waypoints_text(mission: MissionStatus) -> tuple[float, str]:
    """Share of the waypoints visited, 0 to 1, and the same as text."""
    visited, known = mission.waypoint_counts
    return mission.progress, f"{visited} of {known} waypoints" if known else "no waypoints"


def robot_line(snapshot: Snapshot, name: str, robot: RobotStatus) -> str:
    """One robot in one line.

    Args:
        snapshot: The whole mission.
        name: Id of the robot.
        robot: Its status.
    """
    mission, vehicle = robot.mission, robot.vehicle
    parts = [f"[{snapshot.mission_time:7.1f} s] {name} {mission.state.value}"]
    if mission.reason:
        parts[0] += f": {mission.reason}"
    if vehicle is not None:
        parts.append(place_text(vehicle))
        parts.append(f"battery {100 * vehicle.battery.fraction:.0f} %")
    parts.append(waypoints_text(mission)[1])
    slowest = max(
        (stream for stream in snapshot.streams if stream.median_ms is not None),
        key=lambda stream: stream.median_ms or 0.0,
        default=None,
    )
    if slowest is not None:
        parts.append(f"{slowest.name} {slowest.median_ms:.1f} ms")
    dropped = sum(stream.drops for stream in snapshot.streams)
    if dropped:
        parts.append(f"{dropped} dropped")
    return ", ".join(parts)


def robot_panel(name: str, robot: RobotStatus) -> RenderableType:
    """Mission, position and battery of a robot."""
    facts = Table.grid(padding=(0, 1), expand=True)
    facts.add_column(style="dim", width=9, no_wrap=True)
    facts.add_column(ratio=1, overflow="fold")
    mission, vehicle = robot.mission, robot.vehicle
    facts.add_row(Text(name, "bold not dim"), _state(mission))
    facts.add_row("", Text(mission.reason, "italic"))
    facts.add_row("waypoint", _waypoint(mission, vehicle))
    facts.add_row("position", _position(vehicle))
    facts.add_row("battery", _battery(vehicle))
    if mission.outlook is not None:
        facts.add_row("", _outlook(mission.outlook))
    facts.add_row("progress", _progress(mission))
    facts.add_row("flown", f"{mission.distance:.1f} m")
    facts.add_row("faults", _faults(mission, vehicle))
    return facts


def streams_panel(streams: Sequence[StreamSnapshot]) -> RenderableType:
    """Rate, latency and drops of each stream."""
    table = Table(box=None, expand=True, pad_edge=False, header_style="dim")
    table.add_column("stream", ratio=1, overflow="fold")
    for heading in ("per second", "median ms", "p99 ms", "dropped"):
        table.add_column(heading, justify="right", width=10, no_wrap=True)
    for stream in streams:
        dropped = Text(str(stream.drops), "yellow" if stream.drops else "")
        table.add_row(
            stream.name,
            _number(stream.rate),
            _number(stream.median_ms),
            _number(stream.p99_ms),
            dropped,
        )
    return table


def alerts_panel(alerts: Sequence[str]) -> RenderableType:
    """The last few alerts."""
    return Group(*(Text(f"! {alert}", "yellow") for alert in alerts[-_ALERTS:]))


def _state(mission: MissionStatus) -> Text:
    style = _STYLES.get(mission.state, "bold black on bright_blue")
    return Text.assemble((f" {mission.state.value.replace('_', ' ').upper()} ", style))


def _waypoint(mission: MissionStatus, vehicle: VehicleState | None) -> Text:
    if mission.target is None:
        return Text("-")
    target = mission.target
    text = f"{target.id} ({target.x:.1f}, {target.y:.1f}, {target.z:.1f})"
    if vehicle is not None:
        away = float(np.linalg.norm(target.position - vehicle.odometry.position))
        text += f", {away:.1f} m away"
    return Text(text)


def _position(vehicle: VehicleState | None) -> str:
    if vehicle is None:
        return "-"
    speed = math.hypot(*vehicle.odometry.velocity)
    return f"{place_text(vehicle)}, {speed:.1f} m/s"


def _battery(vehicle: VehicleState | None) -> RenderableType:
    if vehicle is None:
        return "-"
    charge = vehicle.battery.fraction
    if math.isnan(charge):
        return "unknown"
    style = next(colour for most, colour in _CHARGE_COLOURS if charge <= most)
    return _bar(charge, f"{100 * charge:.0f} %", style)


def _outlook(outlook: BatteryOutlook) -> str:
    minutes, seconds = divmod(round(outlook.hover), 60)
    plan = f"{outlook.plan:.0%}" if outlook.plan <= 1 else "more"
    return f"returns at {outlook.returns_at:.0%}, in {minutes}:{seconds:02}; plan needs {plan}"


def _progress(mission: MissionStatus) -> RenderableType:
    share, text = waypoints_text(mission)
    return _bar(share, text, "bright_blue")


def _faults(mission: MissionStatus, vehicle: VehicleState | None) -> Text:
    faults = (*mission.faults, *(vehicle.faults if vehicle else ()))
    return Text("; ".join(faults), "red") if faults else Text("none", "dim")


def _bar(share: float, text: str, style: str) -> RenderableType:
    row = Table.grid(padding=(0, 1))
    row.add_column(width=_BAR)
    row.add_column(overflow="fold")
    bar = ProgressBar(
        total=1.0,
        completed=min(max(share, 0.0), 1.0),
        complete_style=style,
        finished_style=style,
    )
    row.add_row(bar, text)
    return row


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
