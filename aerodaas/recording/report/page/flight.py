"""HTML page of one flight."""

from __future__ import annotations

from collections.abc import Sequence

import cv2

from aerodaas.recording.report.moments import MomentPicture
from aerodaas.recording.report.page.document import document, paragraph, picture, section
from aerodaas.recording.report.page.tables import log_section, sections
from aerodaas.recording.report.plot import Plot
from aerodaas.recording.report.summary import FlightSummary
from aerodaas.recording.vehicle_log.attachment import AttachedLog

__all__ = ["flight_page", "origin_line"]

_THUMBNAIL = 640
"""Width in pixels of the images in the page."""
_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 80]


def flight_page(
    summary: FlightSummary,
    plots: Sequence[Plot],
    moments: Sequence[MomentPicture],
    logs: Sequence[AttachedLog] = (),
) -> str:
    """Return the report of a flight as one HTML page."""
    parts = [section(plot.title, picture(plot.png, plot.description)) for plot in plots]
    parts += sections(summary)
    parts += map(log_section, logs)
    if moments:
        shown = "".join(_moment(moment) for moment in moments)
        parts.append(section("Key moments", f'<div class="moments">{shown}</div>', wide=True))
    return document(summary.title, _head(summary), parts, origin_line(summary))


def origin_line(summary: FlightSummary) -> str:
    """Application, revision, seed and versions of a recording, in one line."""
    wanted = ("app", "revision", "seed", "speed", "aerodaas", "python", "platform")
    known = summary.provenance
    return ", ".join(f"{name} {known[name]}" for name in wanted if known.get(name))


def _head(summary: FlightSummary) -> list[str]:
    head = [paragraph(f"Began {summary.begun}")] if summary.begun else []
    for name, robot in summary.robots.items():
        head += [paragraph(f"{name}: {robot.outcome}", "outcome"), paragraph(robot.course)]
    if not summary.complete:
        head.append(
            paragraph(
                "Cut off: the recording was not closed, or parts of it are damaged.", "warning"
            )
        )
    if summary.skipped:
        text = f"{summary.skipped} broken messages or chunks were skipped."
        head.append(paragraph(text, "warning"))
    if summary.drops:
        count = sum(summary.drops.values())
        head.append(paragraph(f"{count} messages were dropped; see below.", "warning"))
    return head


def _moment(moment: MomentPicture) -> str:
    height, width = moment.image.shape[:2]
    image = moment.image
    if width > _THUMBNAIL:
        size = (_THUMBNAIL, round(height * _THUMBNAIL / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(image.dtype)
    _, data = cv2.imencode(".jpg", image, _QUALITY)
    return picture(data.tobytes(), moment.caption, media="image/jpeg", caption=moment.caption)
