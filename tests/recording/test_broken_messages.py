"""A broken message costs that message: all that reads a recording goes on, and says how many."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from rewritten import fields, rewritten, with_field
from synthetic_flight import SyntheticFlight, record
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.recording.decoding.messages import decode_json
from aerodaas.recording.pictures import detections_by_frame, frames
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.recording.replay.environment import read_timetables
from aerodaas.recording.report.comparison import write_comparison
from aerodaas.recording.report.difference import difference
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.report import read_report
from aerodaas.recording.tables import table_of
from aerodaas.text.printable import printable

BROKEN: dict[str, bytes] = {
    "no JSON": b"\xff\x00",
    "nothing": b"",
    "null": b"null",
    "a list": b"[]",
    "empty": b"{}",
    "a text": b'"robot"',
    "deep": b"[" * 50_000,
    "deep and whole": b'{"a":' * 200 + b"1" + b"}" * 200,
    "a lone surrogate": b'{"robot": "\\ud800", "stamp": 1}',
    "a huge number": b'{"stamp": 1' + b"0" * 5000 + b"}",
}
ODD: tuple[Any, ...] = (None, [], {}, "x", -1, 1e300, 10**30, True, [[]], {"x": None}, "\x1b[2J")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short flight with pictures."""
    path = tmp_path_factory.mktemp("flown") / "flight.mcap"
    record(path, SyntheticFlight(rate=2, hover=0.5, frames=1), drops=1)
    return path


def read_all(path: Path, whole: Path) -> None:
    """Read a recording in every manner."""
    read_report_without_plots(path)
    read_timetables(path)
    difference(path, whole)
    difference(whole, path)
    with Recording.open(path) as recording:
        list(vehicle_states(recording, "tello"))
        list(frames(recording))
        detections_by_frame(recording)
        for topic in recording.topics:
            table_of(recording, topic)


def read_report_without_plots(path: Path) -> None:
    """The flight's model; drawing it takes a hundred times as long."""
    with Recording.open(path) as recording:
        RecordedFlight.read(recording)


@pytest.mark.parametrize("kind", BROKEN)
def test_one_broken_message_of_each_channel(flown: Path, tmp_path: Path, kind: str) -> None:
    """It is skipped and counted by topic; every other message is read."""
    met: dict[str, int] = defaultdict(int)

    def change(topic: str, data: bytes) -> bytes:
        met[topic] += 1
        return BROKEN[kind] if met[topic] == 2 else data

    path = rewritten(flown, tmp_path / "broken.mcap", change=change)
    with Recording.open(path) as recording:
        read = [record.topic for record in recording.records()]
        assert recording.damaged == recording.skipped.total()
        for topic, count in met.items():
            assert read.count(topic) == count - recording.skipped[topic]
        ours = {name for name, it in recording.topics.items() if it.schema.startswith("aerodaas.")}
        repeated = {topic for topic, count in met.items() if count > 1}
        assert {topic for topic in ours & repeated if recording.skipped[topic] != 1} == set()
    read_all(path, flown)


@pytest.mark.parametrize("odd", [..., *ODD], ids=repr)
def test_every_field_may_hold_anything(flown: Path, tmp_path: Path, odd: object) -> None:
    """Each message has one odd field, each time another: nothing that reads them raises."""
    turns: dict[str, int] = defaultdict(int)

    def change(topic: str, data: bytes) -> bytes:
        try:
            value = json.loads(data)
        except ValueError:
            return data
        turns[topic] += 1
        places = fields(value)
        if turns[topic] % 3 == 0 or not places:
            return data
        return json.dumps(with_field(value, places[turns[topic] % len(places)], odd)).encode()

    path = rewritten(flown, tmp_path / "odd.mcap", change=change)
    read_all(path, flown)


def test_the_report_tells_what_was_skipped(flown: Path, tmp_path: Path) -> None:
    """In the summary and on the page; the comparison holds it, too; export says it."""
    met: dict[str, int] = defaultdict(int)

    def change(topic: str, data: bytes) -> bytes:
        met[topic] += 1
        return b"{" if topic == "/tello/state" and met[topic] in {3, 4} else data

    path = rewritten(flown, tmp_path / "broken.mcap", change=change)
    report = read_report(path)
    assert report.summary.skipped == 2
    assert "skipped 2 messages or chunks that are broken" in str(report.summary)
    page = write_comparison(path, flown, tmp_path / "both.html").read_text()
    assert "broken and skipped" in page
    words = ["export", "csv", str(path), "/tello/state", "--out", str(tmp_path / "csv")]
    assert "skipped 2 broken messages" in CliRunner().invoke(app, words).output


def test_names_with_dollars_are_drawn(flown: Path, tmp_path: Path) -> None:
    """They begin no formula."""

    def change(_topic: str, data: bytes) -> bytes:
        try:
            json.loads(data)
        except ValueError:
            return data
        return data.replace(b'"tello"', b'"$x_{$"').replace(b'"north"', b'"$\\\\frac$"')

    path = rewritten(flown, tmp_path / "dollars.mcap", change=change)
    report = read_report(path)
    assert "$x_{$" in report.summary.robots
    assert len(report.plots) >= 3


@pytest.mark.parametrize("number", [1e9, -1e9, 1e-300, 0.0])
def test_extreme_figures_are_drawn(flown: Path, tmp_path: Path, number: float) -> None:
    """Positions, batteries, latencies and loads at the ends of what is let in."""

    def other(value: Any) -> Any:  # noqa: ANN401
        if isinstance(value, dict):
            return {key: it if key == "stamp" else other(it) for key, it in value.items()}
        if isinstance(value, list):
            return [other(item) for item in value]
        return number if isinstance(value, float) else value

    def change(topic: str, data: bytes) -> bytes:
        if topic not in {"/tello/state", "/latency"}:
            return data
        return json.dumps(other(json.loads(data))).encode()

    path = rewritten(flown, tmp_path / "extreme.mcap", change=change)
    assert read_report(path).plots


def test_text_cannot_steer_the_terminal() -> None:
    """Escape sequences and changes of the writing direction are shown as question marks."""
    assert printable("a\x1b[2Jb\x07\u202ec\n\td é") == "a?[2Jb??c\n\td é"


def test_json_within_the_bounds_is_unchanged() -> None:
    """Also text outside ASCII, as escapes of two halves."""
    assert decode_json(b'{"a": ["\\ud83d\\ude00", 1, null]}') == {"a": ["\U0001f600", 1, None]}
