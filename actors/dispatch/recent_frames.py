"""Frames by name: a task names its frame, and an executor on the edge has read it already."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from aerodaas.actors.session import FRAME_DEPTH
from aerodaas.types.data import Frame
from aerodaas.types.records import fast_pickle
from aerodaas.types.status import Message

__all__ = ["FrameReference", "FrameReferences", "MissingFrame", "RecentFrames"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class FrameReference:
    """A frame that its reader is expected to hold: stream and number of its message."""

    stream: str
    seq: int


@fast_pickle
@dataclass(frozen=True, slots=True)
class MissingFrame:
    """An executor's answer to a task whose frame it does not hold."""

    reference: FrameReference


class FrameReferences:
    """The sender's side: decides which frames a task may name."""

    def __init__(self) -> None:
        """Start without frames."""
        self._newest: dict[str, int] = {}

    def note(self, message: Message[Any]) -> None:
        """A message of a stream has arrived."""
        self._newest[message.stream] = message.seq

    def item(self, message: Message[Any]) -> object:
        """Content of a task about `message`: its name, or the frame once no reader keeps it."""
        newest = self._newest.get(message.stream, message.seq)
        if isinstance(message.item, Frame) and 0 <= newest - message.seq < FRAME_DEPTH:
            return FrameReference(message.stream, message.seq)
        return message.item


class RecentFrames:
    """The reader's side: the newest frames of some streams, by number."""

    def __init__(self, streams: Iterable[str]) -> None:
        """Keep the newest `FRAME_DEPTH` messages of each of `streams`."""
        self._kept = {stream: deque[Message[Any]](maxlen=FRAME_DEPTH) for stream in streams}

    def note(self, message: Message[Any]) -> None:
        """Keep a message if it is of one of the streams."""
        if message.stream in self._kept:
            self._kept[message.stream].append(message)

    def find(self, reference: FrameReference) -> Message[Any] | None:
        """The message of this name; None if it is not kept (any more)."""
        kept = self._kept.get(reference.stream, ())
        return next((one for one in kept if one.seq == reference.seq), None)
