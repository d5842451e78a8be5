"""Report of a recording: an HTML page, a summary and plots."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import cv2

from aerodaas.config.extras import has_extra
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.moments import MomentPicture, key_moments, picture_moments
from aerodaas.recording.report.page.flight import flight_page
from aerodaas.recording.report.plot import Plot
from aerodaas.recording.report.sheet import contact_sheet
from aerodaas.recording.report.summary import FlightSummary
from aerodaas.types.errors import RecordingError

__all__ = ["Report", "ReportFiles", "read_report", "write_report"]


@dataclass(frozen=True, slots=True)
class Report:
    """Summary, plots and key moments of a recording."""

    summary: FlightSummary
    plots: list[Plot]
    moments: list[MomentPicture]


@dataclass(frozen=True, slots=True)
class ReportFiles:
    """Files written by `write_report`; plots without data are omitted."""

    summary: FlightSummary
    page: Path
    summary_json: Path
    summary_text: Path
    plots: tuple[Path, ...]


def read_report(recording: str | Path) -> Report:
    """Compute the report of a recording.

    Args:
        recording: The MCAP file.

    Returns:
        Summary, plots and key moments; no plots without the extra `plots`.

    Raises:
        RecordingError: If the recording cannot be read or holds no flight.
    """
    with Recording.open(recording) as opened:
        flight = RecordedFlight.read(opened)
        if not flight.robots and not flight.latencies:
            raise RecordingError(f"{recording} holds no flight: no vehicle states and no latencies")
        moments = picture_moments(opened, key_moments(flight))
        summary = FlightSummary.of(opened, flight)
    return Report(summary, _plots(flight), moments)


def _plots(flight: RecordedFlight) -> list[Plot]:
    """The plots of a flight; none without the extra `plots`."""
    if not has_extra("plots"):
        return []
    from aerodaas.recording.report.page.figures import plots_of  # noqa: PLC0415 - needs the extra

    return plots_of(flight)


def write_report(recording: str | Path, folder: str | Path) -> ReportFiles:
    """Write `report.html`, `summary.json`, `summary.txt` and the plots as PNG.

    Args:
        recording: The MCAP file.
        folder: Folder of the files, created if necessary; an earlier report is replaced.

    Returns:
        The summary and the files.

    Raises:
        RecordingError: If the recording cannot be read or holds no flight, or the folder cannot
            be written.
    """
    report, folder = read_report(recording), Path(folder)
    files = ReportFiles(
        report.summary,
        folder / "report.html",
        folder / "summary.json",
        folder / "summary.txt",
        tuple(folder / f"{plot.name}.png" for plot in report.plots),
    )
    contents = {path: plot.png for path, plot in zip(files.plots, report.plots, strict=True)}
    if report.moments:
        _, sheet = cv2.imencode(".png", contact_sheet(report.moments))
        contents[folder / "moments.png"] = sheet.tobytes()
    summary = report.summary
    contents |= {
        files.page: flight_page(summary, report.plots, report.moments).encode(),
        files.summary_json: (json.dumps(summary.as_dict(), indent=2) + "\n").encode(),
        files.summary_text: f"{summary}\n".encode(),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, data in contents.items():
            path.write_bytes(data)
    except OSError as error:
        raise RecordingError(f"cannot write the report to {folder}: {error.strerror}") from None
    return files
