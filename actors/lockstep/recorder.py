"""Recorder actor in lockstep: acknowledges what it has written."""

from __future__ import annotations

from collections import Counter

from aerodaas.actors.lockstep.actor import LockstepActor
from aerodaas.actors.recorder import RecorderActor
from aerodaas.runtime.stream_names import ACKS
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Header
from aerodaas.types.status import Message

__all__ = ["LockstepRecorderActor"]


class LockstepRecorderActor(LockstepActor, RecorderActor):
    """Recorder actor for which mission time waits."""

    def _open(self) -> None:
        super()._open()
        self._acks = self.publisher(f"{ACKS}/recorder")

    def _written(self, headers: list[Header], last: Message[None]) -> None:
        done = tuple((header.source, header.stamp) for header in headers)
        self._acks.derive(done, last, host_time_ns(), last.stamp)

    def _rest(self, counts: Counter[str]) -> None:
        """Go on at once: mission time waits for what is acknowledged."""
