"""Report of a recording: an HTML page, a summary and plots."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aerodaas.config.extras import has_extra
from aerodaas.errors import RecordingError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.moments import MomentPicture, key_moments, picture_moments
from aerodaas.recording.report.page.flight import flight_page
from aerodaas.recording.report.section import Plot, ReportSection, extension_sections
from aerodaas.recording.report.summary import FlightSummary

__all__ = ["SUMMARY", "Report", "ReportFiles", "read_report", "write_report", "write_summary"]

SUMMARY = "summary.json"
"""Name of the file that holds a flight's figures."""


@dataclass(frozen=True, slots=True)
class Report:
    """Summary, plots and key moments of a recording."""

    summary: FlightSummary
    plots: list[Plot]
    moments: list[MomentPicture]
    sections: list[ReportSection]
    """What extensions add."""


@dataclass(frozen=True, slots=True)
class ReportFiles:
    """Files written by `write_report`; plots without data are omitted."""

    summary: FlightSummary
    page: Path
    summary_json: Path
    summary_text: Path
    plots: tuple[Path, ...]
    sections: tuple[ReportSection, ...]
    """What extensions add to the page."""


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
        flight, summary = _read(opened)
        moments = picture_moments(opened, key_moments(flight))
        sections = extension_sections(opened)
    return Report(summary, _plots(flight, sections), moments, sections)


def _read(recording: Recording) -> tuple[RecordedFlight, FlightSummary]:
    flight = RecordedFlight.read(recording)
    if not flight.robots and not flight.latencies:
        raise RecordingError(
            f"{recording.path} holds no flight: no vehicle states and no latencies"
        )
    return flight, FlightSummary.of(recording, flight)


def _plots(flight: RecordedFlight, sections: Sequence[ReportSection]) -> list[Plot]:
    """The plots of a flight and of what extensions add; none without the extra `plots`."""
    if not has_extra("plots"):
        return []
    from aerodaas.recording.report.page.figures import plots_of  # noqa: PLC0415 - needs the extra

    return plots_of(flight, sections)


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
        folder / SUMMARY,
        folder / "summary.txt",
        tuple(folder / f"{plot.name}.png" for plot in report.plots),
        tuple(report.sections),
    )
    contents = {path: plot.png for path, plot in zip(files.plots, report.plots, strict=True)}
    summary = report.summary
    contents |= {
        files.page: flight_page(summary, report.plots, report.moments, report.sections).encode(),
        files.summary_json: _as_json(summary),
        files.summary_text: f"{summary}\n".encode(),
    }
    _write(folder, contents)
    return files


def write_summary(recording: str | Path, folder: str | Path) -> FlightSummary:
    """Write `summary.json` alone, which takes a fifth of a report's time.

    Args:
        recording: The MCAP file.
        folder: Folder of the file, created if necessary.

    Returns:
        The summary.

    Raises:
        RecordingError: As `write_report`.
    """
    with Recording.open(recording) as opened:
        _, summary = _read(opened)
    _write(Path(folder), {Path(folder) / SUMMARY: _as_json(summary)})
    return summary


def _as_json(summary: FlightSummary) -> bytes:
    return (json.dumps(summary.as_dict(), indent=2) + "\n").encode()


def _write(folder: Path, contents: dict[Path, bytes]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, data in contents.items():
            path.write_bytes(data)
    except OSError as error:
        raise RecordingError(f"cannot write the report to {folder}: {error.strerror}") from None
