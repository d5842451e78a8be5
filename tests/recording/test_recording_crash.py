"""What a crash, a full disk or a damaged file leaves can be read."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import foxglove
import pytest
from foxglove import Context, Schema
from foxglove.channel import Channel
from foxglove.mcap import MCAPCompression, MCAPWriteOptions
from foxglove.messages import CompressedImage
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_flight import SyntheticFlight, record

from aerodaas.errors import RecordingError
from aerodaas.recording.pictures import frames
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = pytest.mark.wall_clock

MAGIC = 8
"""Bytes by which an MCAP file is known."""
HERE = Path(__file__).resolve().parents[1]
ROOT = HERE.parent

PROGRAM = """
import sys, time
from pathlib import Path
from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.recording.recorder import FlightRecorder
from synthetic_flight import PROVENANCE, SyntheticFlight
recorder = FlightRecorder(Path(sys.argv[1]), config=RecordingConfig(), provenance=PROVENANCE)
"""

SLEEPER = """
for message in SyntheticFlight(rate=5).messages():
    recorder.write(message)
print("written", flush=True)
time.sleep(600)
"""

FILLER = """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000))
told, further = [], 0
for message in SyntheticFlight(frames=4).messages():
    try:
        recorder.write(message)
    except RecordingError as error:
        told.append(str(error))
    further += bool(told)
    if further == 200:
        break
summary = recorder.close()
assert len(told) == 1, told
assert told[0] == summary.stopped
assert sum(summary.drops.values()) >= 200
assert summary.size <= 500_000
print(told[0])
"""


def start(program: str, path: Path) -> subprocess.Popen[str]:
    """Run a recorder in a process of its own."""
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{HERE}"}
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM + program, str(path)],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short recording of several chunks."""
    path = tmp_path_factory.mktemp("crash") / "flight.mcap"
    record(path, SyntheticFlight(rate=2, hover=1.0, frames=0.2))
    return path


def count(path: Path) -> int:
    """Messages that can be read."""
    with Recording.open(path) as recording:
        return sum(1 for _ in recording.records())


def test_killed_process_leaves_everything_flushed(tmp_path: Path) -> None:
    """Messages reach the file by time, without a close, and outlive SIGKILL."""
    path = tmp_path / "killed.mcap"
    everything = sum(1 for _ in SyntheticFlight(rate=5).messages())
    with start(SLEEPER, path) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "written\n"
        deadline = time.monotonic() + 60
        while states(path) < everything // 3 and time.monotonic() < deadline:
            time.sleep(0.1)
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert states(path) == everything // 3
    with Recording.open(path) as recording:
        assert not recording.complete
        assert recording.provenance["seed"] == "7"
        assert recording.attachments == ["environment.json", "farm_survey.py"]
        assert RecordedFlight.read(recording).robots["tello"].outcome == "landed: mission complete"


def states(path: Path) -> int:
    """Vehicle states that can be read; three of our flight's messages come with each."""
    with Recording.open(path) as recording:
        return sum(1 for _ in recording.records(schemas={"aerodaas.VehicleState"}))


def test_full_disk_stops_recording_once_and_clearly(tmp_path: Path) -> None:
    """The flight goes on, one error says why, and the file ends at a whole record."""
    path = tmp_path / "full.mcap"
    with start(FILLER, path) as process:
        output, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    assert "full.mcap could not be written any further" in output
    with Recording.open(path) as recording:
        assert sum(1 for _ in recording.records()) > 100
        assert recording.damaged == 0


@given(share=st.floats(0, 1))
@settings(max_examples=40)
def test_cut_off_anywhere_reads_a_part(flight: Path, share: float) -> None:
    """A file cut off at any byte is refused clearly or gives what lies before the cut."""
    data = flight.read_bytes()
    cut = flight.with_name("cut.mcap")
    cut.write_bytes(data[: int(share * len(data))])
    whole = count(flight)
    if int(share * len(data)) < MAGIC:
        with pytest.raises(RecordingError, match=r"cut\.mcap"):
            count(cut)
    else:
        found = count(cut)
        assert found <= whole
        assert found == whole or share < 1.0


@given(st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=8))
@settings(max_examples=40)
def test_damaged_anywhere_reads_the_rest(flight: Path, changes: list[tuple[float, int]]) -> None:
    """Bytes changed at random never crash the reader."""
    data = bytearray(flight.read_bytes())
    for share, value in changes:
        data[int(share * len(data))] = value
    damaged = flight.with_name("damaged.mcap")
    damaged.write_bytes(data)
    # RecordingError where not even the first bytes are MCAP's; anything else is a bug.
    with suppress(RecordingError), Recording.open(damaged) as recording:
        RecordedFlight.read(recording)
        list(frames(recording))


def test_damaged_chunk_is_skipped_and_counted(flight: Path, tmp_path: Path) -> None:
    """One bad chunk costs its own messages only."""
    with Recording.open(flight) as recording:
        block = recording._index.blocks[1]
    data = bytearray(flight.read_bytes())
    data[block.offset + block.length // 2] ^= 0xFF
    path = tmp_path / "chunk.mcap"
    path.write_bytes(data)
    with Recording.open(path) as recording:
        found = sum(1 for _ in recording.records())
        assert recording.damaged == 1
    assert 0 < found < count(flight)


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "is empty"), (b"%PDF-1.7 something", "is not an MCAP recording"), (b"\x89MC", "is not")],
)
def test_no_recording(tmp_path: Path, content: bytes, words: str) -> None:
    """Empty and foreign files are told apart."""
    path = tmp_path / "it.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        Recording.open(path)


def test_missing_file(tmp_path: Path) -> None:
    """The path is named."""
    with pytest.raises(RecordingError, match=r"nowhere\.mcap: No such file"):
        Recording.open(tmp_path / "nowhere.mcap")


@pytest.mark.parametrize(
    "options",
    [
        MCAPWriteOptions(compression=MCAPCompression.Lz4),
        MCAPWriteOptions(use_chunks=False),
        MCAPWriteOptions(emit_chunk_indexes=False, emit_message_indexes=False),
    ],
    ids=["lz4", "unchunked", "without an index"],
)
def test_recordings_of_others(flight: Path, tmp_path: Path, options: MCAPWriteOptions) -> None:
    """Pictures that Foxglove's own writer has stored are frames; times count from the first."""
    with Recording.open(flight) as recording:
        (jpeg, *_) = (
            it.value.data for it in recording.records(schemas={"foxglove.CompressedImage"})
        )
    path = tmp_path / "theirs.mcap"
    context = Context()
    schema: Schema = CompressedImage.get_schema()
    writer = foxglove.open_mcap(path, context=context, writer_options=options)
    channel = Channel("/cam", schema=schema, message_encoding="protobuf", context=context)
    for index in range(3):
        image = CompressedImage(frame_id="optical", data=jpeg, format="jpeg")
        channel.log(image.encode(), log_time=1_000 + index)
    writer.close()
    with Recording.open(path) as recording:
        found = list(frames(recording))
        assert recording.complete
        assert recording.provenance == {}
    assert [frame.header.stamp for frame in found] == [0, 1, 2]
    assert found[0].header.source == "optical"
    assert (found[0].width, found[0].height) == (320, 180)
