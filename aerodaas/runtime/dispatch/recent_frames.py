"""References to frames in tasks, for executors on the edge that have received the frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.messages.serialization.records import fast_pickle
from aerodaas.runtime.session import FRAME_DEPTH

__all__ = ["FrameReference", "FrameReferences", "MissingFrame", "RecentFrames"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class FrameReference:
    """Reference to a frame that its reader should hold: stream and number of its message."""

    stream: str
    seq: int


@fast_pickle
@dataclass(frozen=True, slots=True)
class MissingFrame:
    """Answer of an executor to a task whose frame it does not hold."""

    reference: FrameReference


class FrameReferences:
    """Sender's side: decides whether a task refers to its frame or carries it."""

    def __init__(self) -> None:
        """Start without frames."""
        self._newest: dict[str, int] = {}

    def add(self, message: Message[Any]) -> None:
        """Store the number of a stream's newest message."""
        self._newest[message.stream] = message.seq

    def item(self, message: Message[Any]) -> object:
        """Item of a task about `message`: a reference, or the frame if no reader keeps it."""
        newest = self._newest.get(message.stream, message.seq)
        if isinstance(message.item, Frame) and 0 <= newest - message.seq < FRAME_DEPTH:
            return FrameReference(message.stream, message.seq)
        return message.item


class RecentFrames:
    """Reader's side: buffer of the newest frames of some streams."""

    def __init__(self, streams: Iterable[str]) -> None:
        """Keep the newest `FRAME_DEPTH` messages of each of `streams`."""
        self._kept = {stream: deque[Message[Any]](maxlen=FRAME_DEPTH) for stream in streams}

    def add(self, message: Message[Any]) -> None:
        """Keep a message if it is of one of the streams."""
        if message.stream in self._kept:
            self._kept[message.stream].append(message)

    def find(self, reference: FrameReference) -> Message[Any] | None:
        """Message of a reference; None if it is not (or no longer) kept."""
        kept = self._kept.get(reference.stream, ())
        return next((one for one in kept if one.seq == reference.seq), None)
