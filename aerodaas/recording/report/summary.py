"""Summary of a flight in figures, as text and as JSON."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from typing import Any

import numpy as np
from typing_extensions import Self

from aerodaas.clock import NANOSECONDS
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight, StreamLatency

__all__ = ["FlightSummary", "LatencyFigures", "RobotFigures"]


@dataclass(frozen=True, slots=True)
class LatencyFigures:
    """Latency from capture to publishing, in milliseconds of the host's clock."""

    count: int
    median_ms: float
    p99_ms: float
    overhead_ms: float
    """Median of the part without computation: transport between nodes and queueing."""
    age_ms: float
    """Median of results in mission time: in simulated time 0, or what simulated executions took."""
    age_p99_ms: float


@dataclass(frozen=True, slots=True)
class RobotFigures:
    """Figures of one robot's flight."""

    outcome: str
    """Last mission state and its reason."""
    duration_s: float
    """Mission seconds from take-off to landing or to the end of the recording."""
    distance_m: float
    waypoints_planned: int
    waypoints_visited: int
    waypoints_given_up: int
    max_height_m: float | None
    battery_used: float | None
    """Fraction of the full charge, 0 to 1; None if unknown."""
    setpoints_clipped: dict[str, int]
    """Number of setpoints changed by a limit, by limit."""

    @property
    def course(self) -> str:
        """Waypoints, distance, duration and battery used, in one line."""
        visited = f"{self.waypoints_visited} of {self.waypoints_planned} waypoints, "
        used = self.battery_used
        return (
            f"{visited if self.waypoints_planned else ''}{self.distance_m:.1f} m in "
            f"{self.duration_s:.1f} s{'' if used is None else f', {100 * used:.0f} % of battery'}"
        )


@dataclass(frozen=True, slots=True)
class FlightSummary:
    """Figures of a recording."""

    title: str
    duration_s: float
    """Mission seconds recorded."""
    complete: bool
    """Whether the recording was closed properly and is undamaged."""
    robots: dict[str, RobotFigures]
    frames: dict[str, int]
    """Number of frames by camera."""
    latencies: dict[str, LatencyFigures]
    """Latencies by stream."""
    detections: dict[str, int] = field(default_factory=dict)
    """Number of detections over all frames, by label."""
    decisions: dict[str, int] = field(default_factory=dict)
    """Number of scheduler decisions and outcomes by action."""
    reasons: dict[str, int] = field(default_factory=dict)
    """Number of scheduler decisions and outcomes by `action: reason`."""
    utility: dict[str, float] = field(default_factory=dict)
    """Utility gained by the analytics scheduler: `QoS` and `QoE`."""
    alerts: list[dict[str, Any]] = field(default_factory=list)
    drops: dict[str, int] = field(default_factory=dict)
    """Number of messages that did not reach the recorder, by stream."""
    provenance: dict[str, str] = field(default_factory=dict)
    skipped: int = 0
    """Number of messages and chunks of the file that are broken and were left out."""

    @classmethod
    def of(cls, recording: Recording, flight: RecordedFlight) -> Self:
        """Compute the figures of a flight.

        Args:
            recording: Recording of the flight.
            flight: The flight, read from it.
        """
        return cls(
            title=recording.provenance.get("name") or recording.path.stem,
            duration_s=round(recording.duration, 3),
            complete=recording.complete and not recording.damaged,
            robots={name: _robot(robot) for name, robot in flight.robots.items()},
            frames=dict(flight.frames),
            latencies={name: _latency(it) for name, it in flight.latencies.items()},
            detections=dict(flight.detections),
            decisions=dict(flight.decisions),
            reasons={f"{did}: {why}": n for (did, why), n in flight.reasons.most_common()},
            utility={name: round(value, 3) for name, value in flight.utility.items()},
            alerts=[{"time_s": at, "kind": kind, "text": t} for at, kind, t in flight.alerts],
            drops=dict(flight.drops),
            provenance=dict(recording.provenance),
            skipped=recording.damaged + flight.untold,
        )

    @property
    def begun(self) -> str:
        """Date, time and time zone of the start; empty if unknown."""
        try:
            seconds = int(self.provenance["epoch_ns"]) / NANOSECONDS
            began = datetime.fromtimestamp(seconds, timezone.utc).astimezone()
        except (KeyError, ValueError, OverflowError, OSError):
            return ""
        return f"{began:%Y-%m-%d %H:%M:%S %Z}"

    @property
    def simulates_executions(self) -> bool:
        """Whether it flew in simulated time, with results as old as simulated executions say."""
        aged = any(latency.age_p99_ms > 0.0 for latency in self.latencies.values())
        return self.provenance.get("speed") == "max" and aged

    def as_dict(self) -> dict[str, Any]:
        """All fields as a dictionary, for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """A few readable lines."""
        lines = [f"{self.title}: {self.duration_s:.1f} s recorded"]
        if not self.complete:
            lines[0] += " (cut off: the file was not closed or is damaged)"
        if self.skipped:
            lines.append(f"  skipped {self.skipped} messages or chunks that are broken")
        for name, robot in self.robots.items():
            lines.append(f"  {name}: {robot.outcome}; {robot.course}")
        for camera, count in self.frames.items():
            rate = f", {count / self.duration_s:.1f} per second" if self.duration_s else ""
            lines.append(f"  {camera}: {count} frames{rate}")
        for stream, latency in self.latencies.items():
            lines.append(f"  {stream}: {self._latency_text(latency)}")
        if self.decisions:
            lines.append(f"  {_scheduler_text(self)}")
        lines += [f"  alert at {it['time_s']:.1f} s: {it['text']}" for it in self.alerts]
        lines += [f"  dropped {count} of {stream}" for stream, count in self.drops.items()]
        return "\n".join(lines)

    def _latency_text(self, latency: LatencyFigures) -> str:
        figures, clock = (latency.median_ms, latency.p99_ms), ""
        if self.simulates_executions:
            figures, clock = (latency.age_ms, latency.age_p99_ms), " in mission time"
        median, late = figures
        return f"{median:.1f} ms median, {late:.1f} ms 99th percentile since capture{clock}"


def _scheduler_text(summary: FlightSummary) -> str:
    counts = ", ".join(f"{count} {action}" for action, count in summary.decisions.items())
    gained = ", ".join(f"{name} utility {value:.0f}" for name, value in summary.utility.items())
    return f"analytics scheduler: {counts}{'; ' if gained else ''}{gained}"


def _latency(latency: StreamLatency) -> LatencyFigures:
    total, age = (np.percentile(one, [50, 99]) for one in (latency.total, latency.age or [0.0]))
    figures = (*total, np.median(latency.overhead), *age)
    return LatencyFigures(len(latency.total), *(round(float(figure), 3) for figure in figures))


def _robot(robot: RobotFlight) -> RobotFigures:
    on_ground = {"idle", "preflight", "landed", "aborted"}
    flown = sum(band.end - band.start for band in robot.bands if band.state not in on_ground)
    heights = robot.position[:, 2]
    known = robot.battery[np.isfinite(robot.battery)]
    highest = float(np.nanmax(heights)) if np.isfinite(heights).any() else math.nan
    return RobotFigures(
        outcome=robot.outcome,
        duration_s=round(flown, 3),
        distance_m=round(robot.distance, 3),
        waypoints_planned=len(robot.plan.keys() | robot.visited),
        waypoints_visited=len(set(robot.visited)),
        waypoints_given_up=len(robot.given_up),
        max_height_m=round(highest, 3) if math.isfinite(highest) else None,
        battery_used=round(float(known[0] - known[-1]), 4) if len(known) else None,
        setpoints_clipped=dict(robot.clipped),
    )
