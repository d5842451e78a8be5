"""Recordings that hold less than a flight, or tell of it in an odd order."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from synthetic_flight import PROVENANCE, SyntheticFlight

from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.messages.envelope import Message
from aerodaas.recording.pictures import frames
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.replay.environment import read_timetables
from aerodaas.recording.report.comparison import write_comparison
from aerodaas.recording.report.difference import difference
from aerodaas.recording.report.report import read_report, write_report

Messages = list[Message[Any]]


def written(
    path: Path, change: Callable[[Messages], Messages] = list, images: str = "jpeg"
) -> Path:
    """Record a short flight, its messages changed before."""
    config = RecordingConfig.model_validate({"images": images})
    flight = SyntheticFlight(rate=2, hover=1, frames=0.5)
    with FlightRecorder(path, config=config, provenance=PROVENANCE) as recorder:
        for message in change(list(flight.messages())):
            recorder.write(message)
    return path


def without(*kinds: str) -> Callable[[Messages], Messages]:
    """Leave streams out."""
    return lambda messages: [
        m for m in messages if m.stream.partition("/")[2].lstrip("@") not in kinds
    ]


@pytest.mark.parametrize(
    "missing",
    [
        ("state", "camera"),
        *(
            pytest.param(streams, marks=pytest.mark.slow)
            for streams in (("mission",), ("setpoints", "detector"), ("follow", "dispatcher"))
        ),
    ],
    ids="-".join,
)
def test_missing_channels_cost_what_they_held(tmp_path: Path, missing: tuple[str, ...]) -> None:
    """Report, comparison, difference and timetables come of what is there."""
    whole = written(tmp_path / "whole.mcap")
    path = written(tmp_path / "part.mcap", without(*missing))
    assert write_report(path, tmp_path / "report").page.stat().st_size > 10_000
    assert write_comparison(whole, path, tmp_path / "both.html").stat().st_size > 10_000
    found = difference(whole, path)
    assert found.agrees == ("state" in missing)
    assert ("tello/camera" in read_timetables(path)) == ("camera" not in missing)


def test_pictures_alone_are_no_flight(tmp_path: Path) -> None:
    """They can be played; there is nothing to report."""
    path = written(
        tmp_path / "pictures.mcap",
        lambda messages: [m for m in messages if m.stream == "tello/camera"],
    )
    with Recording.open(path) as recording:
        assert len(list(frames(recording))) > 5
    with pytest.raises(RecordingError, match="holds no flight"):
        write_report(path, tmp_path / "report")


@pytest.mark.parametrize("images", ["jpeg", "h264"])
def test_time_that_runs_backwards_is_put_in_order(tmp_path: Path, images: str) -> None:
    """Messages written from the last to the first are read from the first to the last."""
    path = written(tmp_path / "backwards.mcap", lambda messages: messages[::-1], images)
    with Recording.open(path) as recording:
        stamps = [record.stamp for record in recording.records(topics=["/tello/state"])]
        assert stamps == sorted(stamps)
        assert len(stamps) > 50
        back = [frame.header.stamp for frame in frames(recording)]
        assert back == sorted(back)
        assert len(back) > 5
    assert write_report(path, tmp_path / "report").page.exists()


def test_gigabytes_of_zeros_are_no_messages(tmp_path: Path) -> None:
    """What a machine that lost its power leaves behind is read at once, up to the zeros."""
    path = written(tmp_path / "flight.mcap")
    with Recording.open(path) as recording:
        whole = sum(1 for _ in recording.records())
    with path.open("r+b") as file:
        # The summary at the end goes, as it does where a file was not closed.
        file.truncate(path.stat().st_size - 64)
        file.truncate(64 << 30)
    with Recording.open(path) as recording:
        assert not recording.complete
        assert sum(1 for _ in recording.records()) == whole


def test_a_report_without_plots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Summary and page are written all the same."""
    recording = written(tmp_path / "flight.mcap")
    assert read_report(recording).plots
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    files = write_report(recording, tmp_path / "report")
    assert files.plots == ()
    assert files.page.stat().st_size > 1000
