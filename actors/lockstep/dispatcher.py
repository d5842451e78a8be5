"""Dispatcher actor in lockstep: executions take no mission time."""

from __future__ import annotations

import heapq
from collections import deque
from typing import Any

from aerodaas.actors.dispatch.dispatcher import DispatcherActor, Managed
from aerodaas.actors.lockstep.actor import LockstepActor
from aerodaas.runtime.session import Session
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Resources
from aerodaas.types.status import Message

__all__ = ["LockstepDispatcherActor"]

_WAIT = 0.2
"""Wall seconds of one wait for messages."""


class LockstepDispatcherActor(LockstepActor, DispatcherActor):
    """Dispatcher actor that delivers each frame once every task of earlier ones has ended.

    Neither the host's execution times nor a camera's lead may affect the result. Meanwhile the
    scheduler's own time advances from timer to timer.
    """

    answers_always = True

    def __init__(
        self,
        session: Session,
        scheduler: AnalyticsScheduler,
        managed: tuple[Managed, ...],
        resources: Resources,
    ) -> None:
        """Create the actor of `session`, for `resources` without a cloud."""
        super().__init__(session, scheduler, managed, resources)
        self._dispatch.hurried = False
        self._held: deque[Message[Any]] = deque()
        """Frames that wait until every task of earlier ones has ended."""

    def _receive(self, message: Message[Any]) -> None:
        self._held.append(message)

    def _advance(self) -> None:
        while self._dispatch.running is None:
            if not self._dispatch.undecided:
                if not self._held:
                    return
                message = self._held.popleft()
                self._arrive(message, self._time(message.stamp))
            elif self._timers:
                self._now = max(self._now, heapq.heappop(self._timers))
                self._guarded("timer", self._now)
            else:
                self._replace("left tasks undecided without asking to be woken", self._now)
                return

    def _wake_scheduler(self) -> None:
        """Do nothing: `_advance` delivers the timers."""

    def _measure(self, managed: Managed, answer: Message[Any], taken: int) -> None:
        """Do nothing: no mission time is taken."""

    def _reserve(self, deadline: int) -> int:
        del deadline
        return 0

    def _stamp(self, origin: Message[Any]) -> int:
        return origin.stamp

    def _time(self, stamp: int = 0) -> int:
        self._now = max(self._now, stamp)
        return self._now

    def _patience(self) -> float:
        return _WAIT
