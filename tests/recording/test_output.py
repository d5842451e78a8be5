"""The recorder's file when the disk gives up: half a record never stays, and people are told."""

from __future__ import annotations

import errno
import io
import os
import threading
from pathlib import Path

import pytest
from synthetic_flight import PROVENANCE, SyntheticFlight

from aerodaas.config import RecordingConfig
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
