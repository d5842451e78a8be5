"""A vehicle's log attached to its flight's recording, and its topics in the report."""

from __future__ import annotations

import sys
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from flown_logs import EPOCH, Flown, dataflash, record_flown, ulog
from matplotlib.axes import Axes

from aerodaas.cli.app import main
from aerodaas.errors import AeroDaaSError, RecordingError
from aerodaas.extensions.vehicle_logs.attaching import attach_file
from aerodaas.extensions.vehicle_logs.attachment import (
    attach_log,
    attached_logs,
    flight_of,
)
from aerodaas.extensions.vehicle_logs.log import Series
from aerodaas.extensions.vehicle_logs.plots import log_drawing
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.page.figures import plots_of
from aerodaas.recording.report.report import read_report, write_report

FLOWN = Flown()


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A flight."""
    return record_flown(tmp_path / "flight.mcap", FLOWN)


def written(folder: Path, name: str, content: bytes) -> Path:
    """A log's file."""
    file = folder / name
    file.write_bytes(content)
    return file


def drawn(recording: Path, **topics: Series | None) -> dict[str, Axes]:
    """The rows of the attached log's plot by their labels, some topics replaced or removed."""
    with Recording.open(recording) as opened:
        (attached,) = attached_logs(opened)
    assert attached.log is not None
    changed = {**attached.log.topics, **{k.replace("_", " "): v for k, v in topics.items()}}
    log = replace(attached.log, topics={k: v for k, v in changed.items() if v is not None})
    drawing = log_drawing(1, replace(attached, log=log))
    assert drawing is not None
    return {axes.get_ylabel(): axes for axes in drawing.draw().axes}


def test_an_attached_log_lies_over_its_flight(recording: Path, tmp_path: Path) -> None:
    """As it was found when it was attached; with the moment at which it begins."""
    file = written(tmp_path, "00000012.BIN", dataflash(FLOWN, begin=2.0))
    told = attach_log(recording, file)
    assert str(told).startswith("00000012.BIN of drone (ArduPilot) covers 2.0 to 60.0 s")
    with Recording.open(recording) as opened:
        assert opened.attachments == ["vehicle_logs/drone/00000012.BIN"]
        (found,) = attached_logs(opened)
    assert (found.robot, found.file, str(found.alignment)) == (
        "drone",
        "00000012.BIN",
        str(told.alignment),
    )
    data = recording.read_bytes()
    at = data.rindex(b"vehicle_logs/drone/00000012.BIN", 0, data.rindex(b"vehicle_logs/drone"))
    stamp = int.from_bytes(data[at - 20 : at - 12], "little")
    assert stamp / 1e9 == pytest.approx(EPOCH + 2.0, abs=0.01)


def test_what_is_refused_leaves_the_recording(recording: Path, tmp_path: Path) -> None:
    """Another flight's, no log, none at all, and one that is attached already."""
    before = recording.read_bytes()
    for name, content, said in (
        ("other.bin", dataflash(Flown(zero=900.0)), "other.bin is of another flight"),
        ("music.mp3", b"ID3" * 100, "music.mp3 is no log of an autopilot"),
        ("empty.ulg", b"", "empty.ulg is empty"),
    ):
        with pytest.raises(RecordingError, match=said):
            attach_log(recording, written(tmp_path, name, content))
    with pytest.raises(RecordingError, match=r"cannot read the log .*none.bin"):
        attach_log(recording, tmp_path / "none.bin")
    with pytest.raises(AeroDaaSError, match="eagle"):
        attach_log(recording, written(tmp_path, "own.bin", dataflash(FLOWN)), "eagle")
    assert recording.read_bytes() == before
    attach_log(recording, tmp_path / "own.bin", "drone")
    with pytest.raises(RecordingError, match=r"has vehicle_logs/drone/own.bin already"):
        attach_log(recording, tmp_path / "own.bin")


def test_the_report_shows_its_topics(recording: Path, tmp_path: Path) -> None:
    """In a plot said to be from the autopilot's log; its messages at mission seconds."""
    attach_log(recording, written(tmp_path, "own.bin", dataflash(FLOWN)))
    files = write_report(recording, tmp_path / "report")
    assert files.plots[-1].name == "vehicle_log_1.png"
    page = unescape(files.page.read_text())
    assert "From the autopilot's log" in page
    assert "ERR of subsystem 16, code 2" in page
    assert "<th>60.0</th>" in page
    assert "own.bin of drone (ArduPilot) covers 0.0 to 60.0 s of the mission" in page


def test_lines_are_drawn_at_mission_seconds(recording: Path, tmp_path: Path) -> None:
    """Around the flight, in order, and setpoints beside what was flown."""
    attach_log(recording, written(tmp_path, "own.ulg", ulog(FLOWN)))
    rows = drawn(recording)
    angles = ["Roll (°)", "Pitch (°)", "Heading (°)"]
    assert list(rows) == [
        *("Voltage (V)", "Current (A)", *angles),
        *("Vibration (m/s²)", "Motors (%)"),
    ]
    roll = rows["Roll (°)"].lines
    assert [str(line.get_label()) for line in roll] == ["measured", "setpoint"]
    assert [float(np.asarray(line.get_ydata())[0]) for line in roll] == pytest.approx([30.0, 0.0])
    time = np.asarray(roll[0].get_xdata(), dtype=np.float64)
    assert (time[0], time[-1]) == pytest.approx((0.0, 59.9), abs=0.01)
    assert (np.diff(time) >= 0).all()
    assert "PX4's log own.ulg" in rows["Voltage (V)"].get_title(loc="left")


def test_a_line_is_in_order_within_the_flight_and_steps_at_north_are_none(
    recording: Path, tmp_path: Path
) -> None:
    """Whatever the order in the log, and however long it is."""
    attach_log(recording, written(tmp_path, "own.ulg", ulog(FLOWN)))
    time = np.array([70.0, 62.0, 61.0, 60.0, 10.0, 300.0])
    heading = np.array([20.0, 5.0, 355.0, 350.0, 1.0, 2.0])
    angles = {"roll": heading, "pitch": heading, "heading": heading}
    rows = drawn(recording, attitude=Series(time, angles), attitude_setpoint=None)
    roll, shown = (
        np.asarray(rows[label].lines[0].get_ydata()) for label in ("Roll (°)", "Heading (°)")
    )
    assert roll.tolist() == [350.0, 355.0, 5.0, 20.0]
    assert np.array_equal(shown, [350.0, 355.0, np.nan, 5.0, 20.0], equal_nan=True)


def test_what_was_not_measured_has_no_row(recording: Path, tmp_path: Path) -> None:
    """A current of PX4's that is not known, and a log without motors."""
    attach_log(recording, written(tmp_path, "own.ulg", ulog(FLOWN, current=-1.0)))
    rows = drawn(recording, motors=None)
    assert {"Current (A)", "Motors (%)"}.isdisjoint(rows)
    assert "Voltage (V)" in rows


def test_a_log_that_cannot_be_shown_says_why(recording: Path, tmp_path: Path) -> None:
    """In a report that is otherwise whole; names in it are a stranger's."""
    noise = written(tmp_path, "noise", b"noise" * 100)
    labels = ("application/octet-stream", 0)
    attach_file(recording, noise, "vehicle_logs/drone/<b>x</b>", *labels)
    attach_file(recording, noise, "vehicle_logs/eagle/../../x", *labels)
    report = read_report(recording)
    assert [section.rows for section in report.sections] == [(), ()]
    assert plots_of(RecordedFlight(), report.sections) == []
    page = write_report(recording, tmp_path / "report").page.read_text()
    assert "&lt;b&gt;x&lt;/b&gt; of drone is not shown: &lt;b&gt;x&lt;/b&gt; is no log" in page
    assert "../../x of eagle is not shown: no robot in the recording is called" in page


def test_on_the_command_line(
    recording: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """How the log lies over the flight is printed when it is attached, and with the report."""
    log = written(tmp_path, "own.bin", dataflash(FLOWN))

    def run(*words: str) -> tuple[object, str]:
        monkeypatch.setattr(sys, "argv", ["aerodaas", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, capsys.readouterr().out

    for words in (("logs", "attach", str(recording), str(log)), ("report", str(recording))):
        code, told = run(*words)
        assert code == 0
        assert "own.bin of drone (ArduPilot) covers 0.0 to 60.0 s of the mission" in told
    assert run("logs", "attach", str(tmp_path / "none.mcap"), "none.bin")[0] == 2


def test_when_it_flew(recording: Path) -> None:
    """From arming to disarming, by the wall's clock."""
    assert flight_of(recording, "drone") == pytest.approx((EPOCH + 5.0, EPOCH + 55.0))


def test_a_recording_without_an_autopilots_clock_is_told(tmp_path: Path) -> None:
    """A simulated drone's, for one."""
    path = record_flown(tmp_path / "flight.mcap", FLOWN, robots=())
    with pytest.raises(AeroDaaSError, match="no clock of an autopilot"):
        attach_log(path, written(tmp_path, "own.bin", dataflash(FLOWN)))
