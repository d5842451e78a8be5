"""Where everything lies in a file: by its index, at once, or by looking through all of it."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from mcap.writer import CompressionType, Writer
from mcap_files import END

from aerodaas.recording.decoding.index import read_index
from aerodaas.recording.reader import Recording, Topic


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
