"""Stamps, numbers and the frame of a recording: who wrote it, from when, how long."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest
from mcap.reader import make_reader
from synthetic_flight import FENCE, PROVENANCE

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Battery
from aerodaas.recording.encoding import Entry
from aerodaas.recording.live import LiveServer
from aerodaas.recording.messages import Drops, Hop, Latency
from aerodaas.recording.output import RecordingSummary
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.reader import Record, Recording
from aerodaas.recording.recorder import FlightRecorder

SECOND = 1_000_000_000
EPOCH = PROVENANCE.started_ns


def message(
    second: float,
    item: object = "note",
    seq: int = 0,
    spans: tuple[TraceSpan, ...] = (),
    stream: str = "nav/it",
) -> Message[Any]:
    """Something measured a tenth of a second before it was published, captured at 1 ms."""
    stamp = round(second * SECOND)
    header = Header(17, stamp - SECOND // 10, "nav/cam")
    return Message(stream, seq, stamp, header, 1_000_000, spans, item)


def written(path: Path, *messages: Message[Any]) -> RecordingSummary:
    """Record messages."""
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for one in messages:
            recorder.write(one)
        return recorder.close()


def read(path: Path, topic: str) -> list[Record]:
    """What a topic holds."""
    with Recording.open(path) as recording:
        return list(recording.records(topics=[topic]))


def test_the_length_is_from_the_first_message_to_the_latest(tmp_path: Path) -> None:
    """Published at 5, 9 and 7 s of the mission: 4 s, whichever came last."""
    path = tmp_path / "a.mcap"
    summary = written(path, message(5), message(9), message(7))
    assert summary.duration == 4.0
    assert summary.channels == {"/log": 3}
    with Recording.open(path) as recording:
        assert recording.duration == 4.0


def test_each_record_has_its_times_and_its_number(tmp_path: Path) -> None:
    """Published at 3 s and measured at 2.9 s; the number is the message's own."""
    path = tmp_path / "a.mcap"
    written(path, message(3, Battery(0.5), seq=4), message(4, Battery(0.4), seq=9))
    found = read(path, "/nav/it/battery")
    assert [(it.stamp, it.captured, it.sequence) for it in found] == [
        (3 * SECOND, 2_900_000_000, 4),
        (4 * SECOND, 3_900_000_000, 9),
    ]


def test_drops_are_told_at_the_latest_time_known(tmp_path: Path) -> None:
    """Before any message at 0 s, then at 9 s, though a message of 7 s came in between."""
    path = tmp_path / "a.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        recorder.drops("cam", 2)
        recorder.write(message(9))
        recorder.write(message(7))
        recorder.drops("gps", 5)
        recorder.drops("cam")
    found = read(path, "/drops")
    assert [(it.stamp, it.captured, it.sequence) for it in found] == [
        (0, 0, 0),
        (9 * SECOND, 9 * SECOND, 1),
        (9 * SECOND, 9 * SECOND, 2),
    ]
    assert [it.value for it in found] == [
        Drops("cam", dropped=2, total=2),
        Drops("gps", dropped=5, total=5),
        Drops("cam", dropped=1, total=3),
    ]
    with Recording.open(path) as recording:
        assert recording.metadata["aerodaas.drops"] == {"cam": "3", "gps": "5"}


HOP = TraceSpan("cam", 2_000_000, 5_000_000)
SECOND_HOP = TraceSpan("find", 6_000_000, 8_500_000)


@pytest.mark.parametrize(
    ("item", "spans", "told"),
    [
        (None, (), 0),
        (None, (HOP,), 1),
        ("note", (), 0),
        ("note", (HOP,), 0),
        ("note", (HOP, SECOND_HOP), 1),
    ],
)
def test_the_way_is_told_where_nothing_else_tells_it(
    tmp_path: Path, item: object, spans: tuple[TraceSpan, ...], told: int
) -> None:
    """One span of an item is in the item's own record; a lone span without an item is nowhere."""
    path = tmp_path / "a.mcap"
    written(path, message(1, item, spans=spans))
    assert len(read(path, "/latency")) == told
    assert len(read(path, "/log")) == (item is not None)


def test_the_way_of_a_message_in_full(tmp_path: Path) -> None:
    """Captured at 1 ms, each span's wait and work after that."""
    path = tmp_path / "a.mcap"
    written(path, message(3, "note", seq=6, spans=(HOP, SECOND_HOP)))
    (found,) = read(path, "/latency")
    hops = Hop("cam", wait_ms=1.0, work_ms=3.0), Hop("find", wait_ms=1.0, work_ms=2.5)
    assert found.value == Latency("nav/it", 6, 17, "nav/cam", False, 7.5, hops)  # noqa: FBT003
    assert (found.schema, found.stamp, found.captured) == (
        "aerodaas.Latency",
        3 * SECOND,
        2_900_000_000,
    )


def test_an_item_that_cannot_be_written_is_named_where_it_came_from(tmp_path: Path) -> None:
    """An error in the log at the message's time, with its stream's name; one drop counted."""
    path = tmp_path / "a.mcap"
    broken = Detections(Header(1, 2, "c"), (Detection(("x",), "a", 0.5),), 1, 1)  # type: ignore[arg-type]
    summary = written(path, message(3, broken))
    (line,) = read(path, "/log")
    assert (line.value.level, line.value.name, line.stamp) == (4, "nav/it", 3 * SECOND)
    assert line.value.timestamp.ToNanoseconds() == EPOCH + 3 * SECOND
    assert line.value.message.startswith("cannot record a Detections: ")
    assert summary.drops == {"nav/it": 1}


class Live:
    """Takes what a live view would be sent."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, int]] = []

    def put(self, entry: Entry, log_time: int) -> None:
        """Note an entry."""
        self.seen.append((entry.topic, log_time))


def test_a_live_view_gets_what_the_file_gets(tmp_path: Path) -> None:
    """In the same order with the same times: the fence at the mission's zero, then messages."""
    live = Live()
    path = tmp_path / "a.mcap"
    with FlightRecorder(
        path,
        config=RecordingConfig(),
        provenance=PROVENANCE,
        fences={"tello": FENCE},
        live=cast("LiveServer", live),
    ) as recorder:
        recorder.write(message(3))
        recorder.write(message(4, Battery(0.5)))
    with Recording.open(path) as recording:
        kept = [(it.topic, EPOCH + it.stamp) for it in recording.records()]
    assert sorted(live.seen) == sorted(kept)
    assert live.seen[-2:] == [("/log", EPOCH + 3 * SECOND), ("/nav/it/battery", EPOCH + 4 * SECOND)]
    assert {time for topic, time in live.seen if "fence" in topic} == {EPOCH}


@pytest.mark.parametrize(
    ("provenance", "library", "attached"),
    [
        (PROVENANCE, "aerodaas 0.1.0", ["environment.json", "farm_survey.py"]),
        (Provenance(5), "aerodaas", []),
        (Provenance(5, config="{}"), "aerodaas", ["environment.json"]),
        (Provenance(5, app="x.py"), "aerodaas", []),
        (Provenance(5, app_source="pass"), "aerodaas", ["app.py"]),
    ],
)
def test_the_file_says_what_wrote_it(
    tmp_path: Path, provenance: Provenance, library: str, attached: list[str]
) -> None:
    """The version where it is known; the configuration and the application where there are any."""
    path = tmp_path / "a.mcap"
    FlightRecorder(path, config=RecordingConfig(), provenance=provenance).close()
    kinds = {"environment.json": "application/json"}
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().library == library
        for one in reader.iter_attachments():
            assert one.media_type == kinds.get(one.name, "text/x-python")
            assert (one.log_time, one.create_time) == (provenance.started_ns,) * 2
    with Recording.open(path) as recording:
        assert recording.attachments == attached
        assert recording.epoch_ns == provenance.started_ns
        assert recording.complete
