"""Frames that tasks name: an executor finds what the dispatcher names, or says that it cannot."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aerodaas import Frame, Header
from aerodaas.messages.envelope import Message
from aerodaas.runtime.dispatch.recent_frames import FrameReference, FrameReferences, RecentFrames
from aerodaas.runtime.session import FRAME_DEPTH

_PIXELS = np.zeros((2, 2, 3), np.uint8)


def _message(stream: str, seq: int) -> Message[Frame]:
    header = Header(seq, seq * 10, stream)
    return Message(stream, seq, seq * 10, header, 0, (), Frame(header, _PIXELS))


@given(
    arrivals=st.lists(st.tuples(st.sampled_from("ab"), st.integers(0, 3)), min_size=1, max_size=60),
    data=st.data(),
)
def test_what_is_named_is_found(arrivals: list[tuple[str, int]], data: st.DataObject) -> None:
    """Whatever was skipped before: the very frame; and an older one travels itself."""
    sender, reader = FrameReferences(), RecentFrames("ab")
    known: list[Message[Frame]] = []
    numbers = {"a": -1, "b": -1}
    for stream, skipped in arrivals:
        numbers[stream] += 1 + skipped
        known.append(_message(stream, numbers[stream]))
        sender.add(known[-1])
        reader.add(known[-1])
    asked = data.draw(st.sampled_from(known))
    item = sender.item(asked)
    if isinstance(item, FrameReference):
        assert reader.find(item) is asked
    else:
        assert item is asked.item
        assert asked.seq <= numbers[asked.stream] - FRAME_DEPTH


def test_a_frame_that_was_not_received_is_not_found() -> None:
    """Neither one that was skipped, nor one of a stream that is not read."""
    reader = RecentFrames(["a"])
    for seq in (1, 3):
        reader.add(_message("a", seq))
    reader.add(_message("b", 2))
    assert reader.find(FrameReference("a", 2)) is None
    assert reader.find(FrameReference("b", 2)) is None


def test_a_publisher_that_starts_anew_is_not_ahead_of_itself() -> None:
    """A restarted camera counts from nought: frames from before travel themselves."""
    sender = FrameReferences()
    old = _message("a", 900)
    sender.add(old)
    sender.add(_message("a", 0))
    assert sender.item(old) is old.item


def test_other_items_travel_themselves() -> None:
    """Only frames are large."""
    message = _message("a", 1)
    empty: Message[object] = Message("a", 1, 0, message.header, 0, (), None)
    assert FrameReferences().item(empty) is None
