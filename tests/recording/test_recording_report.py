"""Figures and pictures of a flight."""

from __future__ import annotations

import hashlib
import json
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure
from synthetic_flight import PROVENANCE, SyntheticFlight, record

from aerodaas.config.extensions import Extension
from aerodaas.config.model import EnvironmentConfig, RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight
from aerodaas.recording.report.page.document import render_page
from aerodaas.recording.report.plots.trajectory import trajectory_figure
from aerodaas.recording.report.report import write_report
from aerodaas.recording.report.section import Drawing, ReportSection


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole flight with a few frames."""
    path = tmp_path_factory.mktemp("report") / "flight.mcap"
    record(path, SyntheticFlight(frames=1), drops=4)
    return path


def test_summary_tells_the_flight(recorded: Path, tmp_path: Path) -> None:
    """Distance, times, waypoints, battery and drops are those that were flown."""
    files = write_report(recorded, tmp_path / "out")
    written = json.loads(files.summary_json.read_text())
    robot = written["robots"]["tello"]
    assert robot["outcome"] == "landed: mission complete"
    assert robot["distance_m"] == pytest.approx(43.0, abs=0.1)
    assert robot["duration_s"] == pytest.approx(105.0, abs=0.2)
    assert (robot["waypoints_planned"], robot["waypoints_visited"]) == (4, 4)
    assert robot["max_height_m"] == pytest.approx(1.5, abs=0.15)
    assert robot["battery_used"] == pytest.approx(0.004 * 106, abs=0.01)
    assert written["frames"] == {"tello/camera": 106}
    assert written["drops"] == {"tello/camera": 4}
    assert written["decisions"] == {"edge": 106}
    assert written["reasons"] == {"edge: in time": 106}
    assert written["provenance"]["seed"] == "7"
    detector = written["latencies"]["tello/detector"]
    assert 15 < detector["median_ms"] < detector["p99_ms"] < 60
    assert 0.1 < detector["overhead_ms"] < detector["median_ms"]
    text = files.summary_text.read_text()
    assert "tello: landed: mission complete; 4 of 4 waypoints, 43.0 m in 105.0 s" in text
    assert "dropped 4 of tello/camera" in text
    assert "analytics scheduler: 106 edge" in text
    assert "Why the scheduler decided so" in files.page.read_text()


def test_pictures_show_something(recorded: Path, tmp_path: Path) -> None:
    """Each PNG opens, is not blank, and holds many colours."""
    files = write_report(recorded, tmp_path)
    assert [path.stem for path in files.plots] == [
        "trajectory",
        "timeline",
        "latency",
        "outcomes",
    ]
    for path in files.plots:
        image = cv2.imread(str(path))
        assert image is not None
        assert min(image.shape[:2]) > 300
        assert len(np.unique(image[::9, ::9].reshape(-1, 3), axis=0)) > 10


def lift_sections(recording: Recording) -> list[ReportSection]:
    """What an extension for gliders adds to a report."""
    text = f"`{len(recording.topics)}` topics"
    drawings = [Drawing("lift", "Lift over time", "Lift in m/s over mission time", Figure)]
    return [ReportSection("Gliding", text, ("by", "m/s"), [("<b>", 3.0)], "Calm.", drawings)]


def test_an_extension_adds_a_section(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a table and a note, and its plot beside those of the flight."""
    place = f"{__name__}:lift_sections"
    gliders = Extension("gliders", "Gliders.", report_sections=(place,))
    monkeypatch.setattr("aerodaas.config.extensions.extensions", lambda: {"gliders": gliders})
    files = write_report(recorded, tmp_path)
    page = files.page.read_text()
    for shown in ("<h2>Gliding</h2>", "</code> topics</p>", "<th>&lt;b&gt;</th>", "<p>Calm.</p>"):
        assert shown in page
    assert page.index("<h2>Lift over time</h2>") < page.index("<h2>Figures</h2>")
    assert files.plots[-1] == tmp_path / "lift.png"
    assert [added.title for added in files.sections] == ["Gliding"]


def test_words_between_backticks_are_code(tmp_path: Path) -> None:
    """Outside a row's first cell; a stranger's text stays text."""
    template = tmp_path / "own.html"
    template.write_text(
        '{% from "parts.html" import table %}<p>{{ text | marked }}</p>{{ table("ab", rows) }}'
    )
    text = "see `<b>` and a lone `"
    page = render_page(template, text=text, rows=[("`x`", text)])
    assert "<p>see <code>&lt;b&gt;</code> and a lone `</p>" in page
    assert "<th>`x`</th><td>see <code>&lt;b&gt;</code> and a lone `</td>" in page


def test_two_robots_and_a_cut_off_file(tmp_path: Path) -> None:
    """Each robot has its figures; a file that was not closed says so."""
    path = tmp_path / "two.mcap"
    record(path, SyntheticFlight(rate=5), SyntheticFlight("second", offset=(2, 2), rate=5, hover=1))
    path.write_bytes(path.read_bytes()[:-100])
    summary = write_report(path, tmp_path / "out").summary
    assert set(summary.robots) == {"tello", "second"}
    assert not summary.complete
    assert "cut off" in str(summary)


def test_recording_without_a_flight(tmp_path: Path) -> None:
    """Nothing to show is said, not drawn."""
    path = tmp_path / "nothing.mcap"
    FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE).close()
    with pytest.raises(RecordingError, match="holds no flight"):
        write_report(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_folder_that_cannot_be_written(recorded: Path, tmp_path: Path) -> None:
    """The folder is named."""
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot write the report to"):
        write_report(recorded, tmp_path / "file" / "out")


def test_provenance_is_collected_without_passwords(tmp_path: Path) -> None:
    """Of the application's source its SHA-256 is kept, of the camera's address no password."""
    app = tmp_path / "watch.py"
    app.write_text("print('hello')\n")
    camera = {"id": "cam", "driver": "video", "settings": {"path": "rtsp://me:secret@cam/live"}}
    config = EnvironmentConfig.model_validate({"robots": [{"id": "tello", "sensors": [camera]}]})
    found = Provenance.collect(app=app, config=config, seed=9)
    assert found.app_source == ""
    assert found.app_sha256 == hashlib.sha256(app.read_bytes()).hexdigest()
    assert found.as_metadata()["app_sha256"] == found.app_sha256
    assert (found.name, found.seed) == ("watch", 9)
    assert "secret" not in found.config
    assert "rtsp://cam/live" in found.config
    assert found.revision == ""
    assert "python" in found.as_metadata()
    asked = config.recording.model_copy(update={"application_source": True})
    found = Provenance.collect(app=app, config=config.model_copy(update={"recording": asked}))
    assert found.app_source == app.read_text()


def test_the_revision_is_that_of_the_applications_repository(tmp_path: Path) -> None:
    """In full, and marked if files of it were changed."""

    def git(*arguments: str) -> str:
        own = ["git", "-c", "user.name=me", "-c", "user.email=me@example.org", *arguments]
        done = subprocess.run(own, cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    app = tmp_path / "watch.py"
    app.write_text("print('hello')\n")
    git("init", "--quiet")
    assert Provenance.collect(app=app).revision == ""
    git("add", "watch.py")
    git("commit", "--quiet", "--no-gpg-sign", "--message", "first")
    git("tag", "--annotate", "--no-sign", "v1", "--message", "first")
    commit = git("rev-parse", "HEAD")
    (tmp_path / "notes.txt").touch()
    assert Provenance.collect(app=app).revision == commit
    app.write_text("print('bye')\n")
    assert Provenance.collect(app=app).revision == f"{commit}+"


@pytest.mark.parametrize(("count", "most"), [(4, 4), (8, 8), (27, 8)])
def test_the_names_of_many_waypoints_can_be_read(count: int, most: int) -> None:
    """The first and the last are named, and so few between them that none hides another."""
    places = {f"w{number}": (3.0 * number, 0.0, 5.0) for number in range(count)}
    states = [(0.1 * step, 0.3 * step, 0.0, 5.0, 1.0) for step in range(10 * count)]
    flight = RecordedFlight()
    flight.robots["drone"] = RobotFlight(states, plan=places, visited=tuple(places))
    drawn = trajectory_figure(flight).axes[0].texts
    names = [text.get_text() for text in drawn if ". w" in text.get_text()]
    assert len(names) == most
    assert names[0] == "1. w0"
    assert names[-1] == f"{count}. w{count - 1}"
