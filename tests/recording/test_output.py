"""The recorder's file when the disk gives up: half a record never stays, and people are told."""

from __future__ import annotations

import errno
import io
import os
import threading
from pathlib import Path

import pytest
from synthetic_flight import PROVENANCE, SyntheticFlight

from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.recording import recorder
from aerodaas.recording.output import Output
from aerodaas.recording.recorder import FlightRecorder


class FullDisk(io.FileIO):
    """A file that takes three bytes of a write, then says that the disk is full."""

    room = 3

    def write(self, data: object) -> int:
        """Take what there is room for."""
        part = bytes(memoryview(data)[: self.room])  # type: ignore[arg-type]
        if not part:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.room -= len(part)
        return super().write(part)


def test_a_torn_write_is_taken_back(tmp_path: Path) -> None:
    """The file ends where the last whole record ended, and says so."""
    path = tmp_path / "flight.mcap"
    output = Output(path)
    assert output.write(b"whole") == 5
    output._file.close()
    output._file = FullDisk(path, "ab")
    with pytest.raises(OSError, match="No space"):
        output.write(b"torn apart")
    assert path.read_bytes() == b"whole"
    assert output.tell() == 5


def test_after_a_torn_write_the_next_follows_the_last_whole_one(tmp_path: Path) -> None:
    """No gap is left where the torn record was: what is written next begins at its place."""
    path = tmp_path / "flight.mcap"
    output = Output(path)
    output.write(b"whole")
    output._file.close()
    disk = FullDisk(path, "r+b")
    disk.seek(0, os.SEEK_END)
    output._file = disk
    with pytest.raises(OSError, match="No space"):
        output.write(b"torn apart")
    disk.room = 100
    assert output.write(b", again") == 7
    assert path.read_bytes() == b"whole, again"
    assert output.tell() == 12


def test_it_counts_its_bytes_from_none(tmp_path: Path) -> None:
    """Nothing, then 5 bytes, then 8; each write has reached the file when it returns."""
    path = tmp_path / "new" / "folders" / "flight.mcap"
    output = Output(path)
    assert output.tell() == 0
    assert output.write(b"") == 0
    for data, whole in ((b"12345", b"12345"), (b"678", b"12345678")):
        assert output.write(data) == len(data)
        assert path.read_bytes() == whole
        assert output.tell() == len(whole)
    output.sync()
    output.close()
    with pytest.raises(ValueError, match="closed"):
        output.write(b"9")
    assert path.read_bytes() == b"12345678"


def test_where_no_file_can_be_the_path_and_the_remedy_are_named(tmp_path: Path) -> None:
    """A folder that is a file, and a name that no file system takes; no file is left behind."""
    (tmp_path / "text").write_text("mine")
    with pytest.raises(RecordingError) as refused:
        Output(tmp_path / "text" / "run.mcap")
    assert str(refused.value) == (
        f"cannot create {tmp_path}/text/run.mcap: {tmp_path}/text is not a folder; "
        "choose another path"
    )
    with pytest.raises(RecordingError, match=r"cannot create .*: File name too long; choose a"):
        Output(tmp_path / ("x" * 300))
    assert [one.name for one in tmp_path.iterdir()] == ["text"]


def test_short_writes_are_completed(tmp_path: Path) -> None:
    """A system that takes less than it was given is asked again."""
    path = tmp_path / "flight.mcap"
    output = Output(path)
    output._file.close()

    class Slow(io.FileIO):
        def write(self, data: object) -> int:
            return super().write(bytes(memoryview(data)[:3]))  # type: ignore[arg-type]

    output._file = Slow(path, "ab")
    assert output.write(b"12345678") == 8
    assert path.read_bytes() == b"12345678"


def test_a_failed_fsync_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What may not be on the disk is not called written."""
    output = Output(tmp_path / "flight.mcap")

    def broken(_number: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", broken)
    with pytest.raises(OSError, match="Input/output"):
        output.sync()


def test_a_recorder_tells_of_a_failed_fsync(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next message after it is refused, once, and the summary says why."""
    asked = threading.Event()

    def broken(_output: Output) -> None:
        asked.set()
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(recorder, "FLUSH_SECONDS", 0.01)
    monkeypatch.setattr(Output, "sync", broken)
    recording = FlightRecorder(tmp_path / "a.mcap", config=RecordingConfig(), provenance=PROVENANCE)
    assert asked.wait(60)
    recording._flusher.join(60)
    messages = iter(SyntheticFlight().messages())
    with pytest.raises(RecordingError, match="Input/output"):
        recording.write(next(messages))
    recording.write(next(messages))
    assert "Input/output" in recording.close().stopped


def test_a_recorder_that_cannot_begin_closes_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that is full at the start costs the recording, not a file descriptor."""
    closed: list[Path] = []
    close = Output.close

    def full(_output: Output, _data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def watched(output: Output) -> None:
        close(output)
        assert output._file.closed
        closed.append(Path(str(output._file.name)))

    monkeypatch.setattr(Output, "write", full)
    monkeypatch.setattr(Output, "close", watched)
    with pytest.raises(RecordingError, match="No space"):
        FlightRecorder(tmp_path / "a.mcap", config=RecordingConfig(), provenance=PROVENANCE)
    assert closed == [tmp_path / "a.mcap"]
