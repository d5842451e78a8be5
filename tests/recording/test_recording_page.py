"""The report as people get it: one file, whole, and safe whatever was recorded."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic_flight import PROVENANCE, SyntheticFlight, record

from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.vitals import Vitals
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.report.comparison import comparison_page, write_comparison
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.page.flight import flight_page
from aerodaas.recording.report.report import read_report, write_report


class Page(HTMLParser):
    """Checks that tags are closed in order, and gathers what a page refers to."""

    VOID = frozenset({"meta", "link", "img", "!doctype"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.images: list[NDArray[np.uint8]] = []
        self.words = ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag."""
        values = dict(attrs)
        if tag not in self.VOID:
            self.open.append(tag)
        self.links += [values[name] or "" for name in ("src", "href") if name in values]
        if tag == "img":
            assert values["alt"]
            kind, data = (values["src"] or "").split(",", 1)
            assert kind.startswith("data:image/")
            pixels = np.frombuffer(base64.b64decode(data), np.uint8)
            self.images.append(np.asarray(cv2.imdecode(pixels, cv2.IMREAD_COLOR), np.uint8))

    def handle_endtag(self, tag: str) -> None:
        """Expect the tag opened last."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Gather the text."""
        self.words += data


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with a few frames."""
    path = tmp_path_factory.mktemp("page") / "flight.mcap"
    record(path, SyntheticFlight(frames=1, rate=10), drops=4)
    return path


def test_page_is_one_whole_file(recorded: Path, tmp_path: Path) -> None:
    """Well-formed, pictures inside and decodable, nothing fetched from anywhere."""
    page = Page(write_report(recorded, tmp_path).page.read_text())
    assert all(link.startswith("data:") for link in page.links)
    assert len(page.images) >= 4 + 6
    assert all(image.std() > 1 for image in page.images)
    for told in ("landed: mission complete", "4 of 4", "dropped", "tello/camera", "battery_low"):
        assert told in page.words


def test_page_escapes_what_was_recorded(recorded: Path) -> None:
    """A robot called <script> stays text, as do streams, alerts, plots and moments."""
    evil = "<script>alert('x')</script>\""
    report = read_report(recorded)
    (robot,) = report.summary.robots.values()
    summary = replace(
        report.summary,
        title=evil,
        robots={evil: replace(robot, outcome=evil)},
        alerts=[{"time_s": 1.0, "kind": evil, "text": evil}],
        drops={evil: 1},
        reasons={f"{evil}: {evil}": 1},
        provenance={"app": evil},
    )
    plots = [plot._replace(title=evil, description=evil) for plot in report.plots[:1]]
    moments = [replace(one, moment=replace(one.moment, reason=evil)) for one in report.moments[:1]]
    page = flight_page(summary, plots, moments)
    assert "<script" not in page
    assert Page(page).words.count(evil) > 12
    other = replace(report, summary=summary, plots=plots)
    page = comparison_page(evil, other, evil, other)
    assert "<script" not in page
    assert Page(page).words.count(evil) > 12


def test_comparison_holds_both(recorded: Path, tmp_path: Path) -> None:
    """Figures of both, their difference, and each plot twice."""
    other = tmp_path / "other.mcap"
    record(other, SyntheticFlight(frames=0.5, rate=10, hover=2))
    page = Page(write_comparison(recorded, other, tmp_path / "deep" / "page.html").read_text())
    assert len(page.images) == 2 * 4
    assert re.search(r"tello: in the air \(s\)105\.093\.0-12\.0", page.words)


def test_comparison_that_cannot_be_written(recorded: Path, tmp_path: Path) -> None:
    """The page's place is named."""
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot write the comparison"):
        write_comparison(recorded, recorded, tmp_path / "file" / "page.html")


def test_vitals_become_cores_in_use(tmp_path: Path) -> None:
    """Processor seconds between readings, by the host's clock; a restart does not go below zero."""
    path = tmp_path / "vitals.mcap"
    readings = [(0, 1.0), (2_000_000_000, 2.0), (4_000_000_000, 0.5), (5_000_000_000, 0.75)]
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for number, (taken, used) in enumerate(readings):
            header = Header(number, number * 10**9, "drone/tello@node")
            vitals = Vitals(taken, used, 80_000_000, 0.5, 0.25)
            recorder.write(
                Message("@vitals/drone/tello", number, header.stamp, header, taken, (), vitals)
            )
    with Recording.open(path) as recording:
        flight = RecordedFlight.read(recording)
    load = flight.loads["drone/tello"]
    assert load.time == [1.0, 3.0]
    assert load.cpu == [pytest.approx(0.5), pytest.approx(0.25)]
    assert load.memory == [80.0, 80.0]
    assert flight.machines["node"].cpu == [0.5] * 4
