"""What a recorder does when its disk is full or slow, and what its summary then says."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from synthetic_flight import FENCE, PROVENANCE

from aerodaas.config.model import GeofenceConfig, RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.recording import recorder as module
from aerodaas.recording.output import Output
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder

SECOND = 1_000_000_000
LONG = "x" * (2 << 20)
"""More than what is gathered before it is written."""


class Disk:
    """Where recorders write to; full once it is told so."""

    full = False


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    """A disk that can be filled up; nothing is flushed unless a test asks for it."""
    made = Disk()
    write = Output.write

    def limited(output: Output, data: bytes) -> int:
        if made.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(output, data)

    monkeypatch.setattr(Output, "write", limited)
    monkeypatch.setattr(module, "FLUSH_SECONDS", 3600.0)
    return made


def recorder(path: Path, fences: dict[str, GeofenceConfig] | None = None) -> FlightRecorder:
    """A recorder of a new file."""
    return FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE, fences=fences)


def text(item: str, second: float = 1.0, stream: str = "nav/note") -> Message[Any]:
    """A line for the log."""
    stamp = round(second * SECOND)
    return Message(stream, 0, stamp, Header(0, stamp, "nav"), 0, (), item)


def lines(path: Path) -> list[str]:
    """The log as far as it can be read, with nothing in the file damaged."""
    with Recording.open(path) as recording:
        found = [it.value.message for it in recording.records(topics=["/log"])]
        assert recording.damaged == 0
    return found


def test_a_disk_that_fills_up_is_told_once_and_costs_what_follows(
    tmp_path: Path, disk: Disk
) -> None:
    """The first message after it is refused in words, the next two are counted in silence."""
    path = tmp_path / "a.mcap"
    made = recorder(path)
    made.write(text("kept"))
    made.flush()
    disk.full = True
    made.write(text(LONG))
    made.flush()
    with pytest.raises(RecordingError, match="No space left") as told:
        made.write(text("refused"))
    assert str(path) in str(told.value)
    assert "free space on the disk" in str(told.value)
    disk.full = False
    made.write(text("lost"))
    made.write(text("lost", stream="nav/other"))
    made.drops("cam", 4)
    summary = made.close()
    assert summary.stopped == str(told.value)
    assert summary.drops == {"nav/note": 3, "nav/other": 1, "cam": 4}
    assert summary.size == path.stat().st_size
    assert lines(path) == ["kept"]


def test_a_disk_found_full_in_a_flush_is_told_by_the_next_message(
    tmp_path: Path, disk: Disk
) -> None:
    """Flushing says nothing, now or again; of two messages that follow, the first tells."""
    made = recorder(tmp_path / "a.mcap")
    made.write(text("gathered"))
    disk.full = True
    made.flush()
    disk.full = False
    made.flush()
    with pytest.raises(RecordingError, match="No space left"):
        made.write(text("refused"))
    made.write(text("counted"))
    assert made.close().drops == {"nav/note": 2}
    assert lines(tmp_path / "a.mcap") == []


def test_a_disk_found_full_by_a_drop_is_told_by_the_next_message(
    tmp_path: Path, disk: Disk
) -> None:
    """A drop is counted whatever the disk says, and never raises."""
    made = recorder(tmp_path / "a.mcap")
    disk.full = True
    made.drops(LONG, 2)
    made.drops(LONG)
    with pytest.raises(RecordingError, match="No space left"):
        made.write(text("refused"))
    summary = made.close()
    assert summary.drops == {LONG: 3, "nav/note": 1}
    assert "No space left" in summary.stopped


def test_a_disk_found_full_at_the_end_is_in_the_summary(tmp_path: Path, disk: Disk) -> None:
    """Closing never raises, and gives the file back; what was flushed before can be read."""
    path = tmp_path / "a.mcap"
    made = recorder(path)
    made.write(text("kept"))
    made.flush()
    made.write(text("lost"))
    disk.full = True
    summary = made.close()
    assert "No space left" in summary.stopped
    assert "stopped early" in str(summary)
    assert made.close() is summary
    assert made._output._file.closed
    assert lines(path) == ["kept"]


def test_what_cannot_be_synced_at_the_end_is_told(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is whole as far as can be seen, and closed; the summary says what went wrong."""
    path = tmp_path / "a.mcap"
    made = recorder(path)
    made.write(text("there"))

    def broken(_number: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", broken)
    assert not disk.full
    assert "Input/output error" in made.close().stopped
    assert made._output._file.closed
    assert lines(path) == ["there"]


@pytest.mark.usefixtures("disk")
def test_everything_is_on_the_disk_when_closing_returns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last thing before the file is closed is a sync, of the whole file."""
    path = tmp_path / "a.mcap"
    made = recorder(path)
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda _number: synced.append(path.stat().st_size))
    summary = made.close()
    assert synced == [summary.size]
    assert summary.stopped == ""


@pytest.mark.usefixtures("disk")
def test_a_file_that_cannot_be_closed_is_closed_for_all_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error of closing, as network drives give it, is no reason to fail a flight."""
    made = recorder(tmp_path / "a.mcap")
    made.write(text("there"))

    def broken(_output: Output) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(Output, "close", broken)
    summary = made.close()
    assert (summary.messages, summary.stopped) == (1, "")


def test_messages_reach_the_file_by_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody flushes or closes; once it was synced twice, a message can be read by others."""
    monkeypatch.setattr(module, "FLUSH_SECONDS", 0.01)
    twice = threading.Semaphore(0)
    sync = Output.sync

    def watched(output: Output) -> None:
        sync(output)
        twice.release()

    made = recorder(tmp_path / "a.mcap")
    made.write(text("there"))
    monkeypatch.setattr(Output, "sync", watched)
    assert twice.acquire(timeout=60)
    assert twice.acquire(timeout=60)
    assert lines(tmp_path / "a.mcap") == ["there"]
    made.close()


def test_an_error_of_the_flight_closes_the_file(tmp_path: Path) -> None:
    """What a flight that failed has recorded is a complete file."""
    path = tmp_path / "a.mcap"

    def fails() -> None:
        with recorder(path) as made:
            made.write(text("there"))
            raise KeyError

    with pytest.raises(KeyError):
        fails()
    with Recording.open(path) as recording:
        assert recording.complete
    assert lines(path) == ["there"]


def test_what_comes_after_the_end_is_counted_by_nobody(tmp_path: Path) -> None:
    """A late message or drop changes neither the file nor the summary."""
    path = tmp_path / "a.mcap"
    made = recorder(path)
    first = made.close()
    content = path.read_bytes()
    made.write(text("late"))
    made.drops("cam")
    made.flush()
    assert made.close() is first
    assert (first.drops, first.messages, first.duration) == ({}, 0, 0.0)
    assert path.read_bytes() == content


@pytest.mark.parametrize("fences", [None, {"tello": FENCE}], ids=["no fence", "a fence"])
@pytest.mark.parametrize("place", range(3))
def test_a_disk_full_at_the_start_names_the_file_and_why(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    fences: dict[str, GeofenceConfig] | None,
    place: int,
) -> None:
    """Whichever of the first writes fails; no thread and no descriptor stays."""
    path = tmp_path / "a.mcap"
    files: list[Any] = []
    write: Callable[[Output, bytes], int] = Output.write

    def limited(output: Output, data: bytes) -> int:
        files.append(output._file)
        if len(files) > place:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(output, data)

    monkeypatch.setattr(Output, "write", limited)
    threads = threading.active_count()
    with pytest.raises(RecordingError) as refused:
        recorder(path, fences=fences)
    assert str(refused.value) == f"cannot write {path}: No space left on device"
    assert files[-1].closed
    assert threading.active_count() == threads


def test_video_that_cannot_be_encoded_is_refused_before_there_is_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only video asks for the encoder."""

    def none() -> None:
        raise RecordingError("no encoder")

    monkeypatch.setattr(module, "require_encoder", none)
    video = RecordingConfig.model_validate({"images": "h264"})
    with pytest.raises(RecordingError, match="no encoder"):
        FlightRecorder(tmp_path / "a.mcap", config=video, provenance=PROVENANCE)
    assert list(tmp_path.iterdir()) == []
    recorder(tmp_path / "a.mcap").close()


def test_a_sync_that_fails_in_flight_is_told_by_a_message_that_follows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A memory card that is pulled out is no secret until the landing."""
    monkeypatch.setattr(module, "FLUSH_SECONDS", 0.01)
    failed = threading.Event()

    def broken(_number: int) -> None:
        failed.set()
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", broken)
    made = recorder(tmp_path / "a.mcap")
    assert failed.wait(20.0)
    made._flusher.join(20.0)
    with pytest.raises(RecordingError, match="Input/output error"):
        made.write(text("refused"))
    assert "Input/output error" in made.close().stopped
