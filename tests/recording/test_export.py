"""What leaves a recording for other programs is right by those programs' own reading."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer
from synthetic_flight import HOME, SyntheticFlight, record

from aerodaas.errors import RecordingError
from aerodaas.recording.new_file import file_name, new_file
from aerodaas.recording.reader import Recording
from aerodaas.recording.tables import table_of, write_csv, write_parquet


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with a few frames."""
    path = tmp_path_factory.mktemp("export") / "flight.mcap"
    record(path, SyntheticFlight(frames=0.5, rate=10))
    return path


def test_csv_holds_every_message(recorded: Path, tmp_path: Path) -> None:
    """Nested fields are columns, and numbers are the recorded ones to the last digit."""
    with Recording.open(recorded) as recording:
        path = write_csv(recording, "tello/state", tmp_path)
        states = [record.value for record in recording.records(topics=["/tello/state"])]
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["odometry.position.x"]) for row in rows] == [
        state.odometry.position[0] for state in states
    ]
    assert rows[3]["mode"] == "guided"
    assert float(rows[-1]["recorded_s"]) == pytest.approx(states[-1].stamp / 1e9)


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1+2", "@SUM(A1)", "\t=1", "\r=1"])
def test_a_text_of_a_stranger_is_no_formula(tmp_path: Path, text: str) -> None:
    """Neither as a value nor as a column's name; numbers below zero stay numbers."""
    path = tmp_path / "odd.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("odd", "jsonschema", b"{}")
        channel = writer.register_channel("/odd", "json", schema)
        content = {"said": text, "depth": -1.5, text: 1, "plain": "a=b"}
        writer.add_message(channel, 1, json.dumps(content).encode(), 1)
        writer.finish()
    with Recording.open(path) as recording:
        table = write_csv(recording, "/odd", tmp_path)
    with table.open(newline="") as file:
        header, row = csv.reader(file)
    named = dict(zip(header, row, strict=True))
    assert named["said"] == f"'{text}"
    assert named[f"'{text}"] == "1"
    assert float(named["depth"]) == -1.5
    assert named["plain"] == "a=b"


def test_binary_channels_have_rows_too(recorded: Path) -> None:
    """A protobuf message becomes columns, its pictures a length."""
    with Recording.open(recorded) as recording:
        rows = table_of(recording, "/tello/camera/image")
        fixes = table_of(recording, "/tello/state/location")
    assert rows[0]["format"] == "jpeg"
    assert rows[0]["data"].endswith("bytes>")
    assert fixes[0]["latitude"] == pytest.approx(HOME.latitude, abs=1e-3)


def test_parquet_reads_back(recorded: Path, tmp_path: Path) -> None:
    """The same columns and rows, by pyarrow."""
    with Recording.open(recorded) as recording:
        expected = table_of(recording, "/latency")
        path = write_parquet(recording, "/latency", tmp_path)
    table = pyarrow.parquet.read_table(path).to_pylist()
    assert [row["total_ms"] for row in table] == [row["total_ms"] for row in expected]


def test_unknown_channel_names_its_neighbours(recorded: Path, tmp_path: Path) -> None:
    """A typing error is answered with what is there."""
    with (
        Recording.open(recorded) as recording,
        pytest.raises(RecordingError, match=r"it has: .*/tello/state"),
    ):
        write_csv(recording, "telo/state", tmp_path)


def test_nothing_is_overwritten(recorded: Path, tmp_path: Path) -> None:
    """A file in the way stays as it is."""
    (tmp_path / "tello-state.csv").write_text("mine")
    with (
        Recording.open(recorded) as recording,
        pytest.raises(RecordingError, match="already exists"),
    ):
        write_csv(recording, "/tello/state", tmp_path)
    assert (tmp_path / "tello-state.csv").read_text() == "mine"


@given(st.text(max_size=400), st.text(max_size=400))
def test_any_topic_has_a_name_that_a_file_may_have(one: str, other: str) -> None:
    """A recording may have any names; what is cut stays apart."""
    names = [file_name(topic) for topic in (one, other, "a" * 300 + one, "a" * 300 + other)]
    assert all(re.fullmatch(r"[A-Za-z0-9_-]{0,100}", name) for name in names)
    assert (names[2] == names[3]) is (one == other)


def test_a_folder_that_cannot_be_is_named(tmp_path: Path) -> None:
    """An --out that no system takes is an error with its name, not a traceback."""
    with pytest.raises(RecordingError, match="cannot make the folder"):
        new_file(tmp_path / ("x" * 300) / "a.csv")
