"""Files attached to a finished recording: nothing else of it changes, whatever goes wrong."""

from __future__ import annotations

import errno
import os
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import SeekingReader
from mcap.writer import Writer
from mcap_files import END, Said, write_file

from aerodaas.errors import RecordingError
from aerodaas.extensions.vehicle_logs import attaching as module
from aerodaas.extensions.vehicle_logs.attaching import attach_file
from aerodaas.recording.reader import Recording

SAID = [Said(f"/{number % 3}", number * 1000 + 10, number) for number in range(300)]
LOG = os.urandom(3_000_000)
"""More than what is copied at a time."""
LABELS = ("logs/one", "application/x-log", 7_000)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A file to attach."""
    file = tmp_path / "one.log"
    file.write_bytes(LOG)
    return file


def everything(path: Path) -> tuple[list[Any], dict[str, Any], bool]:
    """Messages, metadata and completeness."""
    with Recording.open(path) as opened:
        records = [(one.topic, one.stamp, one.value) for one in opened.records()]
        return records, opened.metadata, opened.complete


def only_files(folder: Path) -> set[str]:
    """Names of what is in a folder."""
    return {one.name for one in folder.iterdir()}


def test_all_that_was_recorded_stays(tmp_path: Path, log: Path) -> None:
    """Byte by byte."""
    path = write_file(tmp_path / "flight.mcap", SAID, metadata={"aerodaas": {"seed": "1"}})
    before, old = everything(path), path.read_bytes()
    attach_file(path, log, *LABELS)
    assert everything(path) == before
    end = old.rindex(END)
    assert path.read_bytes()[:end] == old[:end]
    with Recording.open(path) as opened:
        assert opened.attachments == ["notes", "logs/one"]
        opened.extract("logs/one", tmp_path / "copy", 4_000_000)
        assert opened.attachment("logs/one") == LOG
    assert (tmp_path / "copy").read_bytes() == LOG
    assert only_files(tmp_path) == {"flight.mcap", "one.log", "copy"}


def test_the_index_is_whole(tmp_path: Path, log: Path) -> None:
    """By the library's own reader: counts, places, checksums of summary, attachment and data."""
    path = tmp_path / "flight.mcap"
    with path.open("wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start()
        schema = writer.register_schema("one", "jsonschema", b"{}")
        channel = writer.register_channel("/one", "json", schema)
        for number in range(100):
            writer.add_message(channel, number, b"{}", number)
        writer.finish()
    attach_file(path, log, *LABELS)
    attach_file(path, log, "logs/two", "application/x-log", 8_000)
    data = path.read_bytes()
    end = data.rindex(END)
    assert int.from_bytes(data[end + 9 : end + 13], "little") == zlib.crc32(data[:end])
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.attachment_count == 2
        assert [one.name for one in summary.attachment_indexes] == ["logs/one", "logs/two"]
        found = list(reader.iter_attachments())
        assert [(one.name, one.log_time, one.data) for one in found] == [
            ("logs/one", 7_000, LOG),
            ("logs/two", 8_000, LOG),
        ]
        assert len(list(reader.iter_messages())) == 100


def no_space(*_: object) -> None:
    """The disk is full."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def interrupted(*_: object) -> None:
    """Somebody presses Ctrl-C."""
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("place", "deed", "error"),
    [
        ("_encoded", no_space, RecordingError),
        ("_encoded_summary", interrupted, KeyboardInterrupt),
        ("_check_same", interrupted, KeyboardInterrupt),
    ],
)
def test_an_interruption_leaves_the_old_one(
    tmp_path: Path,
    log: Path,
    monkeypatch: pytest.MonkeyPatch,
    place: str,
    deed: Callable[..., None],
    error: type[BaseException],
) -> None:
    """Wherever it comes, and nothing beside it."""
    path = write_file(tmp_path / "flight.mcap", SAID)
    old = path.read_bytes()
    monkeypatch.setattr(module, place, deed)
    with pytest.raises(error):
        attach_file(path, log, *LABELS)
    assert path.read_bytes() == old
    assert only_files(tmp_path) == {"flight.mcap", "one.log"}


def test_what_changes_meanwhile_is_left_alone(
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two that attach at once: the second one is refused."""
    path = write_file(tmp_path / "flight.mcap", SAID)
    check = module._check_same

    def meanwhile(*words: Any) -> None:  # noqa: ANN401
        monkeypatch.setattr(module, "_check_same", check)
        attach_file(path, log, "logs/other", "application/x-log", 1)
        check(*words)

    monkeypatch.setattr(module, "_check_same", meanwhile)
    with pytest.raises(RecordingError):
        attach_file(path, log, *LABELS)
    with Recording.open(path) as opened:
        assert opened.attachments == ["notes", "logs/other"]


def test_one_that_is_still_written_is_refused(tmp_path: Path, log: Path) -> None:
    """Its writer would go on writing the old one."""
    path = write_file(tmp_path / "flight.mcap", SAID, finish=False)
    with pytest.raises(RecordingError, match="still being written"):
        attach_file(path, log, *LABELS)


def test_the_same_name_twice_is_refused(tmp_path: Path, log: Path) -> None:
    """Neither replaced nor doubled."""
    path = write_file(tmp_path / "flight.mcap", SAID)
    attach_file(path, log, *LABELS)
    old = path.read_bytes()
    with pytest.raises(RecordingError, match="has logs/one already; rename"):
        attach_file(path, log, *LABELS)
    assert path.read_bytes() == old


def test_a_damaged_attachment_is_told(tmp_path: Path, log: Path) -> None:
    """By its checksum, and by its bound."""
    path = write_file(tmp_path / "flight.mcap", SAID)
    attach_file(path, log, *LABELS)
    data = bytearray(path.read_bytes())
    data[data.index(LOG[:100]) + 50] ^= 1
    path.write_bytes(data)
    with Recording.open(path) as opened:
        with pytest.raises(RecordingError, match=r"'logs/one' of .* is damaged"):
            opened.extract("logs/one", tmp_path / "copy", 4_000_000)
        with pytest.raises(RecordingError, match="more than the 1000 that are read"):
            opened.extract("logs/one", tmp_path / "copy", 1000)
        with pytest.raises(RecordingError, match="no attachment 'none'"):
            opened.extract("none", tmp_path / "copy", 1000)
