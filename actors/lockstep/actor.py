"""Base of the actors in lockstep: no message is dropped, and time follows the messages."""

from __future__ import annotations

from aerodaas.actors.base import StreamActor
from aerodaas.actors.streams import MAX_DEPTH
from aerodaas.types.clock import LockstepClock

__all__ = ["LockstepActor"]


class LockstepActor(StreamActor):
    """Mixin of an actor in lockstep, to precede its real-time class."""

    most_under_way = MAX_DEPTH
    """As many as a queue holds; the barrier keeps the number small."""

    def follow(self, stamp: int) -> None:
        """Advance the mission clock to `stamp`, the time of a received message."""
        with self._alerting:
            if isinstance(self.clock, LockstepClock) and stamp > self.clock.now():
                self.clock.advance_to(stamp)
