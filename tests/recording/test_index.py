"""Where everything lies in a file: by its index, at once, or by looking through all of it."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from mcap.writer import CompressionType, Writer
from mcap_files import END, Said, write_file

from aerodaas.recording.decoding.index import load, read_index
from aerodaas.recording.reader import Recording, Topic

FLIGHT = [Said("/a", 1_100, 0), Said("/b", 1_200, 1), Said("/a", 1_300, 2), Said("/a", 1_400, 3)]


def test_loose_messages_are_gathered_into_blocks_of_about_a_megabyte(tmp_path: Path) -> None:
    """Of three of 600 kB, two make a block and the third its own; each block knows its own."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start()
        schema = writer.register_schema("own.Said", "jsonschema", b"{}")
        one, two = (writer.register_channel(topic, "json", schema) for topic in ("/1", "/2"))
        for channel, time in ((two, 30), (one, 10), (one, 20)):
            writer.add_message(channel, time, b'"%s"' % (b"x" * 600_000), time)
        writer.finish()
    with path.open("rb") as file:
        blocks = read_index(file, path.stat().st_size).blocks
        assert [(it.start, it.end, it.channels) for it in blocks] == [
            (10, 30, {one, two}),
            (20, 20, {one}),
        ]
        assert [len(list(load(file, block))) for block in blocks] == [2, 1]
    with Recording.open(path) as recording:
        assert [it.stamp for it in recording.records()] == [0, 10, 20]


def test_blocks_of_a_file_with_chunks_are_its_chunks(tmp_path: Path) -> None:
    """The same whether its index told of them or they were found: place, times and channels."""
    whole = write_file(tmp_path / "a.mcap", FLIGHT, "small chunks")
    cut = write_file(tmp_path / "b.mcap", FLIGHT, "small chunks", finish=False)
    found = []
    for path in (whole, cut):
        with path.open("rb") as file:
            index = read_index(file, path.stat().st_size)
        blocks = [block for block in index.blocks if block.channels]
        found.append(([(b.offset, b.length, b.start, b.end, b.channels) for b in blocks], index))
    assert found[0][0] == found[1][0]
    assert [times[2:4] for times in found[0][0]] == [(it.time, it.time) for it in FLIGHT]
    assert found[0][1].counts == found[1][1].counts == {1: 3, 2: 1}


class Watched(BytesIO):
    """A file that counts the bytes read from it."""

    taken = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """Count what is read."""
        data = super().read(size)
        self.taken += len(data)
        return data


def test_a_file_with_an_index_is_opened_without_reading_its_messages(tmp_path: Path) -> None:
    """Of 100 messages of 1 kB, less than a tenth is read; without the index, all of it."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, chunk_size=50_000)
        writer.start()
        channel = writer.register_channel("/raw", "own", 0)
        for time in range(100):
            writer.add_message(channel, time, bytes(1000), time)
        writer.finish()
    data = path.read_bytes()
    whole, cut = Watched(data), Watched(data[: data.rindex(END)])
    found = [read_index(file, len(file.getvalue())) for file in (whole, cut)]
    assert whole.taken < 10_000
    assert cut.taken > 100_000
    assert [index.complete for index in found] == [True, False]
    assert [index.counts for index in found] == [{1: 100}, {1: 100}]
    assert found[0].blocks == found[1].blocks


def test_a_topic_on_which_nothing_was_said_is_known(tmp_path: Path) -> None:
    """It is in a closed file's index alone, with no message."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.register_channel("/raw", "own", 0)
        writer.finish()
    with Recording.open(path) as recording:
        assert recording.topics == {"/raw": Topic("/raw", "", "own", 0)}
        assert recording.complete
        assert (recording.duration, recording.epoch_ns) == (0.0, 0)
        assert list(recording.records()) == []
