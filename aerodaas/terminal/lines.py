"""View for a log file or a pipe: one line every few seconds."""

from __future__ import annotations

from aerodaas.messages.mission import RobotStatus
from aerodaas.terminal.panels import place_text, waypoints_text
from aerodaas.terminal.snapshot import Snapshot

__all__ = ["robot_line"]


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
