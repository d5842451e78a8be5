"""Tables of a flight's figures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerodaas.config.printable import printable
from aerodaas.recording.report.page.document import paragraph, section, table
from aerodaas.recording.report.summary import FlightSummary
from aerodaas.recording.vehicle_log.attachment import AttachedLog

__all__ = ["figures", "log_section", "sections"]

_MOST_TEXTS = 200
"""Messages of an autopilot that are listed."""


def figures(summary: FlightSummary) -> dict[str, object]:
    """All single figures of a flight by name, in reading order."""
    found: dict[str, object] = {"recorded (s)": summary.duration_s}
    for name, robot in summary.robots.items():
        found |= {
            f"{name}: outcome": robot.outcome,
            f"{name}: in the air (s)": robot.duration_s,
            f"{name}: flown (m)": robot.distance_m,
            f"{name}: waypoints": f"{robot.waypoints_visited} of {robot.waypoints_planned}",
            f"{name}: waypoints given up": robot.waypoints_given_up,
        }
        if robot.max_height_m is not None:
            found[f"{name}: highest (m)"] = robot.max_height_m
        if robot.battery_used is not None:
            found[f"{name}: battery used (%)"] = 100 * robot.battery_used
        for limit, count in robot.setpoints_clipped.items():
            found[f"{name}: setpoints changed by {limit}"] = count
    for camera, count in summary.frames.items():
        found[f"{camera}: frames"] = count
        if summary.duration_s:
            found[f"{camera}: frames per second"] = count / summary.duration_s
    found |= {f"seen: {label}": count for label, count in summary.detections.items()}
    found |= {f"scheduler: {action}": count for action, count in summary.decisions.items()}
    found |= {f"scheduler: {name} utility": gained for name, gained in summary.utility.items()}
    found["alerts"] = len(summary.alerts)
    found["dropped"] = sum(summary.drops.values())
    if summary.skipped:
        found["broken and skipped"] = summary.skipped
    return found


def sections(summary: FlightSummary) -> Iterator[str]:
    """Yield sections of figures, latencies, scheduler reasons, alerts and dropped messages."""
    yield section("Figures", table(["", ""], figures(summary).items()))
    if summary.latencies:
        rows: list[tuple[object, ...]] = [
            (stream, it.count, it.median_ms, it.p99_ms, it.overhead_ms)
            for stream, it in summary.latencies.items()
        ]
        head = ["stream", "count", "median (ms)", "99th perc.", "overhead"]
        if summary.simulates_executions:
            ages = [(it.age_ms, it.age_p99_ms) for it in summary.latencies.values()]
            rows = [(*row, *age) for row, age in zip(rows, ages, strict=True)]
            head += ["in mission time", "99th perc."]
        yield section("Latency since capture", table(head, rows))
    if summary.reasons:
        why = [(*said.split(": ", 1), count) for said, count in summary.reasons.items()]
        head = ["decision or outcome", "reason", "tasks"]
        yield section("Why the scheduler decided so", table(head, why), wide=True)
    if summary.alerts:
        yield section("Alerts", table(["at (s)", "kind", "text"], _alerts(summary)))
    if summary.drops:
        what = paragraph("Messages that did not reach the recording, by stream.")
        yield section("Dropped", what, table(["stream", "messages"], summary.drops.items()))
    else:
        yield section("Dropped", paragraph("Nothing: every message of every stream was recorded."))


def log_section(attached: AttachedLog) -> str:
    """A section on one vehicle's own log: how it lies over the flight, and its messages."""
    told = paragraph(str(attached))
    if attached.log is None or attached.alignment is None:
        return section("The autopilot's own log", told, wide=True)
    texts = attached.log.texts
    rows = [
        (
            f"{attached.alignment.clock.mission_time(np.array(one.time)):.1f}",
            one.severity,
            printable(one.text),
        )
        for one in texts[:_MOST_TEXTS]
    ]
    shown = table(["at (s)", "severity", "message of the autopilot"], rows) if rows else ""
    left_out = len(texts) - len(rows)
    more = paragraph(f"{left_out} more messages are in the log.") if left_out else ""
    return section("The autopilot's own log", told, shown, more, wide=True)


def _alerts(summary: FlightSummary) -> list[tuple[str, str, str]]:
    """The first alert of each kind, with its number of occurrences."""
    first: dict[str, tuple[str, str]] = {}
    times: dict[str, int] = {}
    for alert in summary.alerts:
        first.setdefault(alert["kind"], (f"{alert['time_s']:.1f}", alert["text"]))
        times[alert["kind"]] = times.get(alert["kind"], 0) + 1
    return [
        (at, kind, text if times[kind] == 1 else f"{text} ({times[kind]} times)")
        for kind, (at, text) in first.items()
    ]
