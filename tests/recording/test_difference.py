"""What counts as the same decision, and how a difference is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_flight import PROVENANCE, SyntheticFlight

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.mission import Decision
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.report.difference import box_shift, difference


def write(path: Path, messages: list[Message[Any]]) -> Path:
    """Record messages."""
    with FlightRecorder(
        path, config=RecordingConfig(images="none"), provenance=PROVENANCE
    ) as recorder:
        for message in messages:
            recorder.write(message)
    return path


@pytest.fixture(scope="module")
def messages() -> list[Message[Any]]:
    """A flight with detections, navigation and decisions."""
    return list(SyntheticFlight(frames=1, rate=5, hover=1).messages())


def test_the_same_flight_agrees(messages: list[Message[Any]], tmp_path: Path) -> None:
    """Whatever the latency, results of the same measurement are paired."""
    slow = [replace(m, stamp=m.stamp + 5_000_000, captured=m.captured - 10**9) for m in messages]
    found = difference(write(tmp_path / "a.mcap", messages), write(tmp_path / "b.mcap", slow))
    assert found.agrees
    assert {stream.what for stream in found.streams} == {
        "tello mission states",
        "tello setpoints asked for",
        "tello/detector detections",
        "tello/follow navigation",
        "scheduler decisions",
        "alerts",
    }
    assert str(found).endswith("every decision is the same")


def test_each_difference_is_counted(messages: list[Message[Any]], tmp_path: Path) -> None:
    """A moved box, a missing result and another action are told apart."""
    changed: list[Message[Any]] = []
    for message in messages:
        item = message.item
        if isinstance(item, Detections) and message.header.id == 3:
            left, top, right, bottom = item.items[0].box
            moved = replace(item.items[0], box=(left + 4, top, right, bottom))
            item = replace(item, items=(moved,))
        if message.stream == "tello/follow" and message.header.id == 5:
            continue
        if isinstance(item, Decision) and item.task == "detector#7":
            item = replace(item, action="cloud")
        changed.append(replace(message, item=item))
    found = difference(write(tmp_path / "a.mcap", messages), write(tmp_path / "b.mcap", changed))
    by_name = {stream.what: stream for stream in found.streams}
    seen = by_name["tello/detector detections"]
    assert (seen.differing, seen.only_first, seen.only_second) == (1, 0, 0)
    assert seen.boxes is not None
    assert (seen.boxes.paired, seen.boxes.lost, seen.boxes.new) == (1, 0, 0)
    assert seen.boxes.median_pixels == pytest.approx(4.0)
    follow = by_name["tello/follow navigation"]
    assert (follow.differing, follow.only_first) == (0, 1)
    decided = by_name["scheduler decisions"]
    assert decided.differing == 1
    assert "edge of detector#7 became cloud of detector#7" in str(decided)
    assert not found.agrees


boxes = st.lists(
    st.tuples(
        st.sampled_from(["person", "car"]),
        st.floats(0, 500),
        st.floats(0, 300),
        st.floats(5, 100),
        st.floats(5, 100),
        st.floats(0, 1),
    ),
    max_size=6,
)


def objects(items: list[tuple[Any, ...]]) -> list[Detection]:
    """Detections of a label, a corner, a size and a score each."""
    return [Detection((x, y, x + w, y + h), label, score) for label, x, y, w, h, score in items]


@given(boxes, st.randoms())
def test_order_of_boxes_does_not_matter(items: list[tuple[Any, ...]], random: Any) -> None:  # noqa: ANN401
    """The same objects in another order have not moved."""
    found = objects(items)
    shuffled = list(found)
    random.shuffle(shuffled)
    shift = box_shift([(found, shuffled)])
    assert shift.paired == len(found)
    assert (shift.lost, shift.new) == (0, 0)
    # Of boxes that differ by less than a number can tell, either may be taken for the other.
    assert shift.most_pixels == pytest.approx(0.0, abs=1e-6)


@given(boxes, boxes)
def test_every_object_is_accounted_for(
    one: list[tuple[Any, ...]], other: list[tuple[Any, ...]]
) -> None:
    """Each is paired, lost or new."""
    first, second = objects(one), objects(other)
    shift = box_shift([(first, second)])
    assert shift.paired + shift.lost == len(first)
    assert shift.paired + shift.new == len(second)
