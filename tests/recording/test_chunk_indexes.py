"""A recorder keeps nothing of what it has written, and its file has its whole index."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from synthetic_flight import PROVENANCE

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.recorder import FlightRecorder

_CHUNKS = 300


def _write(recorder: FlightRecorder, first: int, count: int) -> None:
    """Messages of one topic, a chunk each."""
    for seq in range(first, first + count):
        item = Odometry(np.array([float(seq), 0.0, 0.0]), np.zeros(3), 0.0)
        stamp = seq * 1_000_000
        recorder.write(Message("odometry", seq, stamp, Header(seq, stamp, "it"), 0, (), item))
        recorder.flush()


def _objects() -> int:
    gc.collect()
    return len(gc.get_objects())


def test_objects_kept_do_not_grow_with_the_chunks(tmp_path: Path) -> None:
    """After a warm-up, hundreds of chunks leave no object behind."""
    recording = FlightRecorder(
        tmp_path / "flight.mcap", config=RecordingConfig(), provenance=PROVENANCE
    )
    with recording as recorder:
        _write(recorder, 0, 20)
        before = _objects()
        _write(recorder, 20, _CHUNKS)
        # Other threads of this process come by a few objects meanwhile.
        assert _objects() - before < _CHUNKS // 2


def test_the_file_has_the_index_of_every_chunk(tmp_path: Path) -> None:
    """Each chunk's index is in the summary, with its channels, and its messages are found by it."""
    path = tmp_path / "flight.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        _write(recorder, 0, _CHUNKS)
    assert [one.name for one in tmp_path.iterdir()] == ["flight.mcap"]
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        indexes = summary.chunk_indexes
        assert len(indexes) == summary.statistics.chunk_count >= _CHUNKS
        assert all(index.message_index_offsets for index in indexes)
        start = PROVENANCE.started_ns + 100 * 1_000_000
        found = list(reader.iter_messages(starting_at=start, ending_at=start))
        assert {message.sequence for _, _, message in found} == {100}
