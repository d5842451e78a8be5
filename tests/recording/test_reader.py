"""A recording reads the same however it was written, and as far as it goes where it was cut."""

from __future__ import annotations

import errno
import os
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import InvalidMagic
from mcap.writer import Writer
from mcap_files import END, KINDS, Said, write_file

from aerodaas.errors import RecordingError
from aerodaas.recording import reader
from aerodaas.recording.decoding.index import read_index
from aerodaas.recording.reader import Record, Recording, Topic

EPOCH = 1_000
FLIGHT = [Said("/a", 1_100, 0), Said("/b", 1_200, 1), Said("/a", 1_300, 2), Said("/a", 1_400, 3)]
OURS = {"aerodaas": {"epoch_ns": str(EPOCH), "seed": "7"}, "more": {"key": "value"}}


def numbers(path: Path, **chosen: Any) -> list[int]:  # noqa: ANN401 - as of `records`
    """The messages' numbers, as read."""
    with Recording.open(path) as recording:
        return [it.value["number"] for it in recording.records(**chosen)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("finish", [True, False], ids=["closed", "cut off"])
def test_a_file_reads_the_same_however_it_was_written(
    tmp_path: Path,
    kind: str,
    finish: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    """Messages, times, topics, length, metadata and attachment; only a cut-off one is not whole."""
    path = write_file(tmp_path / "a.mcap", FLIGHT, kind, OURS, finish=finish)
    with Recording.open(path) as recording:
        assert list(recording.records()) == [
            Record("/a", "own.Said", 100, 90, 0, {"number": 0}),
            Record("/b", "own.Said", 200, 190, 1, {"number": 1}),
            Record("/a", "own.Said", 300, 290, 2, {"number": 2}),
            Record("/a", "own.Said", 400, 390, 3, {"number": 3}),
        ]
        assert recording.topics == {
            "/a": Topic("/a", "own.Said", "json", 3),
            "/b": Topic("/b", "own.Said", "json", 1),
        }
        assert recording.duration == pytest.approx(300e-9)
        assert recording.complete == finish
        assert recording.damaged == 0
        assert recording.metadata == OURS
        assert recording.provenance == OURS["aerodaas"]
        assert recording.attachments == ["notes"]
        assert recording.attachment("notes") == b"calm, 12 degrees"


@pytest.mark.parametrize("kind", ["no chunks", "small chunks"])
def test_cut_at_any_byte_it_gives_every_whole_message_before_the_cut(
    tmp_path: Path, kind: str
) -> None:
    """A message counts from its last byte on, and not a byte earlier; no cut is damage."""
    whole = write_file(tmp_path / "a.mcap", FLIGHT, kind, OURS, finish=False)
    data = whole.read_bytes()
    index = read_index(BytesIO(data), len(data))
    if kind == "small chunks":
        ends = [block.offset + block.length for block in index.blocks]
    else:
        # A head of 9 bytes, 22 bytes of numbers and times, and {"number": 0}.
        ends = [data.index(b'{"number": %d}' % number) + 13 for number in range(4)]
    assert ends[-1] <= len(data)
    path = tmp_path / "cut.mcap"
    for cut in range(8, len(data) + 1):
        path.write_bytes(data[:cut])
        with Recording.open(path) as recording:
            found = [it.value["number"] for it in recording.records()]
            assert found == list(range(sum(end <= cut for end in ends)))
            assert not recording.complete
            assert recording.damaged == 0


@pytest.mark.parametrize("size", range(8))
def test_less_than_the_first_mark_is_no_recording(tmp_path: Path, size: int) -> None:
    """Nothing at all is told from what is no recording; with the mark, it is an empty one."""
    data = write_file(tmp_path / "a.mcap", FLIGHT).read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[:size])
    with pytest.raises(RecordingError) as refused:
        Recording.open(path)
    words = "not an MCAP recording; give the .mcap file that a run has written"
    assert str(refused.value) == (
        f"{path} is {words}" if size else f"{path} is empty: nothing was recorded"
    )
    path.write_bytes(data[:8])
    with Recording.open(path) as recording:
        assert list(recording.records()) == []
        assert (recording.topics, recording.metadata, recording.attachments) == ({}, {}, [])
        assert (recording.duration, recording.epoch_ns, recording.damaged) == (0.0, 0, 0)
        assert not recording.complete


@pytest.mark.parametrize("body", [b"", b"other people's"])
@pytest.mark.parametrize("place", ["first", "last"])
def test_records_of_kinds_unknown_are_passed_over(tmp_path: Path, body: bytes, place: str) -> None:
    """Others may add records of their own, of any length, before the messages or after them."""
    path = write_file(tmp_path / "a.mcap", FLIGHT, "no chunks", finish=False)
    data = path.read_bytes()
    own = bytes([0x99]) + len(body).to_bytes(8, "little") + body
    path.write_bytes(data[:8] + own + data[8:] if place == "first" else data + own)
    assert numbers(path) == [0, 1, 2, 3]
    with Recording.open(path) as recording:
        assert recording.damaged == 0


def test_a_file_closed_without_a_message_is_complete(tmp_path: Path) -> None:
    """It has its metadata, and lasts no time."""
    with Recording.open(write_file(tmp_path / "a.mcap", [], metadata=OURS)) as recording:
        assert recording.complete
        assert recording.duration == 0.0
        assert recording.epoch_ns == EPOCH
        assert recording.attachments == ["notes"]


@pytest.mark.parametrize("finish", [True, False], ids=["closed", "cut off"])
def test_every_damaged_chunk_is_counted(tmp_path: Path, *, finish: bool) -> None:
    """Two of four are damaged, whether the file has its index or not."""
    path = write_file(tmp_path / "a.mcap", FLIGHT, "small chunks", finish=finish)
    data = path.read_bytes().replace(b'{"number": 2}', b'{"number":!2}')
    path.write_bytes(data.replace(b'{"number": 1}', b'{"number":!1}'))
    with Recording.open(path) as recording:
        assert [it.value["number"] for it in recording.records()] == [0, 3]
        assert recording.damaged == 2


def test_damage_in_what_nobody_asks_for_is_not_looked_at(tmp_path: Path) -> None:
    """Chunks without a message of the topics wanted are left alone."""
    path = write_file(tmp_path / "a.mcap", FLIGHT, "small chunks")
    path.write_bytes(path.read_bytes().replace(b'{"number": 2}', b'{"number":!2}'))
    with Recording.open(path) as recording:
        assert len(list(recording.records(topics=["/b"]))) == 1
        assert recording.damaged == 0
        for _ in range(2):
            assert len(list(recording.records(topics=["/a"]))) == 2
            assert recording.damaged == 1


def test_a_damaged_index_is_made_anew(tmp_path: Path) -> None:
    """Every message is found without it, whichever of its bytes is wrong."""
    path = write_file(tmp_path / "a.mcap", FLIGHT, "small chunks", OURS)
    data = bytearray(path.read_bytes())
    for place in range(data.rindex(END) + 13, len(data) - 8):
        data[place] ^= 0xFF
        path.write_bytes(data)
        with Recording.open(path) as recording:
            assert [it.value["number"] for it in recording.records()] == [0, 1, 2, 3]
            assert list(recording.topics) == ["/a", "/b"]
            assert recording.metadata == OURS
            assert recording.damaged == 0
        data[place] ^= 0xFF


@pytest.mark.parametrize("finish", [True, False], ids=["closed", "cut off"])
def test_which_messages_are_wanted(
    tmp_path: Path,
    finish: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    """By topic, by schema, by both at once; of names that are not there, none."""
    path = write_file(tmp_path / "a.mcap", FLIGHT, "small chunks", finish=finish)
    assert numbers(path, topics=["/a"]) == [0, 2, 3]
    assert numbers(path, topics=["/b", "/c"]) == [1]
    assert numbers(path, topics=[]) == []
    assert numbers(path, schemas=["own.Said"]) == [0, 1, 2, 3]
    assert numbers(path, schemas=["own.Other"]) == []
    assert numbers(path, schemas=["own.Said"], topics=["/b"]) == [1]
    assert numbers(path, schemas=["own.Other"], topics=["/b"]) == []


@settings(max_examples=40)
@given(
    times=st.lists(st.integers(10, 30), max_size=12),
    kind=st.sampled_from(["chunks", "small chunks", "no chunks", "no index"]),
)
def test_messages_come_by_time(
    tmp_path_factory: pytest.TempPathFactory, times: list[int], kind: str
) -> None:
    """However their chunks overlap; in one chunk, those of one time come as they were written."""
    path = tmp_path_factory.mktemp("order") / "a.mcap"
    said = [Said(f"/{number % 2}", time, number) for number, time in enumerate(times)]
    write_file(path, said, kind)
    with Recording.open(path) as recording:
        found = [(recording.epoch_ns + it.stamp, it.value["number"]) for it in recording.records()]
        assert recording.epoch_ns == min(times, default=0)
        length = max(times, default=0) - min(times, default=0)
        assert recording.duration == pytest.approx(length / 1e9)
    assert [time for time, _ in found] == sorted(times)
    assert sorted(found) == sorted((time, number) for number, time in enumerate(times))
    if kind in {"chunks", "no index"}:
        assert found == sorted(found)


@pytest.mark.parametrize(
    ("metadata", "epoch"),
    [
        ({}, 1_100),
        ({"other": {"epoch_ns": "5"}}, 1_100),
        ({"aerodaas": {"seed": "7"}}, 1_100),
        ({"aerodaas": {"epoch_ns": "soon"}}, 1_100),
        ({"aerodaas": {"epoch_ns": "0"}}, 0),
        ({"aerodaas": {"epoch_ns": "900"}}, 900),
    ],
)
def test_time_counts_from_our_word_or_else_from_the_first_message(
    tmp_path: Path, metadata: dict[str, dict[str, str]], epoch: int
) -> None:
    """A message logged at 1100 ns is at 0 without a word of ours, at 200 ns after 900."""
    path = write_file(tmp_path / "a.mcap", FLIGHT[::-1], "small chunks", metadata)
    with Recording.open(path) as recording:
        assert recording.epoch_ns == epoch
        first = next(recording.records())
    assert (first.stamp, first.captured) == (1_100 - epoch, 1_090 - epoch)


def test_what_has_no_schema_is_bytes_or_json(tmp_path: Path) -> None:
    """A channel of another encoding gives what it holds; the schema's name is empty."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, encoding in (("/raw", "own"), ("/json", "json")):
            channel = writer.register_channel(topic, encoding, 0)
            writer.add_message(channel, 5, b'{"a":[1,2]}', 5)
        writer.finish()
    with Recording.open(path) as recording:
        found = {it.topic: (it.schema, it.value) for it in recording.records()}
        assert recording.topics["/raw"] == Topic("/raw", "", "own", 1)
    assert found == {"/raw": ("", b'{"a":[1,2]}'), "/json": ("", {"a": [1, 2]})}


def test_an_attachment_that_is_missing_or_damaged_is_named(tmp_path: Path) -> None:
    """With those that there are, or none."""
    path = write_file(tmp_path / "a.mcap", FLIGHT)
    with Recording.open(path) as recording, pytest.raises(RecordingError) as refused:
        recording.attachment("map")
    assert str(refused.value) == f"{path} has no attachment 'map'; it has: notes"
    data = path.read_bytes()
    path.write_bytes(data.replace(b"\x10" + bytes(7) + b"calm", b"\x11" + bytes(7) + b"calm"))
    with (
        Recording.open(path) as recording,
        pytest.raises(RecordingError, match=r"the attachment 'notes' of .*a\.mcap is damaged"),
    ):
        recording.attachment("notes")
    path.write_bytes(data[:8])
    with Recording.open(path) as recording, pytest.raises(RecordingError, match=r"it has: none$"):
        recording.attachment("notes")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EIO, os.strerror(errno.EIO)), "cannot read {}: Input/output error"),
        (InvalidMagic(b"x"), "{} is not an MCAP recording"),
        (ValueError("x"), "{} is not an MCAP recording"),
    ],
)
def test_a_file_that_cannot_be_read_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, words: str
) -> None:
    """Whatever is wrong with it; the error names the path."""
    path = write_file(tmp_path / "a.mcap", FLIGHT)
    seen: list[BinaryIO] = []

    def broken(file: BinaryIO, _size: int) -> None:
        seen.append(file)
        raise error

    monkeypatch.setattr(reader, "read_index", broken)
    with pytest.raises(RecordingError) as refused:
        Recording.open(path)
    assert str(refused.value).startswith(words.format(path))
    assert seen[0].closed


def test_a_folder_is_no_recording(tmp_path: Path) -> None:
    """The newest recording in it is named, if there is any."""
    with pytest.raises(RecordingError) as refused:
        Recording.open(tmp_path)
    assert str(refused.value) == f"{tmp_path} is a folder without recordings"
    for age, name in enumerate(("b.mcap", "a.mcap", "c.mcap")):
        write_file(tmp_path / name, FLIGHT)
        os.utime(tmp_path / name, (1000 - age, 1000 - age))
    with pytest.raises(RecordingError) as refused:
        Recording.open(tmp_path)
    newest = tmp_path / "b.mcap"
    said = (
        f"{tmp_path} is a folder: give a recording, such as its newest, {newest}; 2 more are there"
    )
    assert str(refused.value) == said


@pytest.mark.parametrize("kind", ["chunks", "small chunks", "no chunks", "no index"])
def test_a_part_is_read_by_time(tmp_path: Path, kind: str) -> None:
    """Both ends included; what is bare is told without its value."""
    said = [Said("/a" if number % 2 else "/b", 1000 + number, number) for number in range(40)]
    path = write_file(tmp_path / "a.mcap", said, kind)
    with Recording.open(path) as recording:
        found = list(recording.records(since=10, until=20, bare={"/b"}))
        assert [one.stamp for one in found] == list(range(10, 21))
        assert [one.value for one in found if one.topic == "/b"] == [None] * 6
        assert [one.value for one in found if one.topic == "/a"] == [
            {"number": number} for number in range(11, 20, 2)
        ]
        assert [one.stamp for one in recording.records(topics={"/a"}, until=2)] == [1]
        assert [one.stamp for one in recording.records(since=38)] == [38, 39]
        # Read again, from what is kept.
        assert list(recording.records(since=10, until=20, bare={"/b"})) == found
