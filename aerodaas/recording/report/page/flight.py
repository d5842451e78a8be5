"""HTML page of one flight."""

from __future__ import annotations

from collections.abc import Sequence

import cv2

from aerodaas.recording.report.moments import MomentPicture
from aerodaas.recording.report.page.document import render_page
from aerodaas.recording.report.section import Plot, ReportSection
from aerodaas.recording.report.summary import FlightSummary

__all__ = ["figures", "flight_page", "origin_line"]

_THUMBNAIL = 640
"""Width in pixels of the images in the page."""
_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 80]
_LATENCY = ["stream", "count", "median (ms)", "99th perc.", "overhead"]
_AGE = ["in mission time", "99th perc."]


def flight_page(
    summary: FlightSummary,
    plots: Sequence[Plot],
    moments: Sequence[MomentPicture],
    sections: Sequence[ReportSection] = (),
) -> str:
    """Return the report of a flight as one HTML page.

    Args:
        summary: Figures of the flight.
        plots: Plots of the page.
        moments: Pictures of moments of the flight.
        sections: What extensions add.
    """
    ages = summary.simulates_executions
    return render_page(
        "flight.html",
        title=summary.title,
        origin=origin_line(summary),
        summary=summary,
        plots=plots,
        figures=figures(summary),
        latency_head=[*_LATENCY, *_AGE] if ages else _LATENCY,
        latencies=[
            (stream, it.count, it.median_ms, it.p99_ms, it.overhead_ms)
            + ((it.age_ms, it.age_p99_ms) if ages else ())
            for stream, it in summary.latencies.items()
        ],
        reasons=[(*said.split(": ", 1), count) for said, count in summary.reasons.items()],
        alerts=_alerts(summary),
        sections=sections,
        moments=[(moment.caption, _thumbnail(moment)) for moment in moments],
    )


def origin_line(summary: FlightSummary) -> str:
    """Application, revision, seed and versions of a recording, in one line."""
    wanted = ("app", "revision", "seed", "speed", "aerodaas", "python", "platform")
    known = summary.provenance
    return ", ".join(f"{name} {known[name]}" for name in wanted if known.get(name))


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


def _thumbnail(moment: MomentPicture) -> bytes:
    height, width = moment.image.shape[:2]
    image = moment.image
    if width > _THUMBNAIL:
        size = (_THUMBNAIL, round(height * _THUMBNAIL / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(image.dtype)
    return cv2.imencode(".jpg", image, _QUALITY)[1].tobytes()
