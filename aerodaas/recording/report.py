"""From a recording to the files that people look at."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from aerodaas.errors import RecordingError
from aerodaas.recording.flight import Flight
from aerodaas.recording.plots import latency_figure, timeline_figure, trajectory_figure
from aerodaas.recording.reader import Recording
from aerodaas.recording.summary import FlightSummary

__all__ = ["ReportFiles", "write_report"]

_DPI = 150


@dataclass(frozen=True, slots=True)
class ReportFiles:
    """What `write_report` has written; pictures for which there was no data are missing."""

    summary: FlightSummary
    summary_json: Path
    summary_text: Path
    plots: tuple[Path, ...]


def write_report(recording: str | Path, folder: str | Path) -> ReportFiles:
    """Write `summary.json`, `summary.txt` and the plots of a recording into `folder`.

    An earlier report in `folder` is replaced. Raises RecordingError if the recording cannot be
    read, holds no flight, or the folder cannot be written.
    """
    with Recording.open(recording) as opened:
        flight = Flight.read(opened)
        summary = FlightSummary.of(opened, flight)
    if not flight.robots and not flight.latencies:
        raise RecordingError(f"{recording} holds no flight: no vehicle states and no latencies")
    figures = {}
    if any(robot.states for robot in flight.robots.values()):
        outcomes = [robot.outcome for robot in flight.robots.values()]
        title = f"{summary.title}\n{outcomes[0]}" if len(outcomes) == 1 else summary.title
        figures["trajectory"] = trajectory_figure(flight, title)
        figures["timeline"] = timeline_figure(flight, title)
    if flight.latencies:
        figures["latency"] = latency_figure(flight, summary.title)
    folder = Path(folder)
    json_path, text_path = folder / "summary.json", folder / "summary.txt"
    plots = {folder / f"{name}.png": figure for name, figure in figures.items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        json_path.write_text(json.dumps(summary.as_dict(), indent=2) + "\n", encoding="utf-8")
        text_path.write_text(f"{summary}\n", encoding="utf-8")
        for path, figure in plots.items():
            figure.savefig(path, dpi=_DPI)
    except OSError as error:
        raise RecordingError(f"cannot write the report to {folder}: {error.strerror}") from None
    return ReportFiles(summary, json_path, text_path, tuple(plots))
