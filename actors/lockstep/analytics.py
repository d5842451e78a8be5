"""Analytics actor in lockstep: every item is processed, at its own mission time."""

from __future__ import annotations

from typing import Any

from aerodaas.actors.analytics import AnalyticsActor
from aerodaas.actors.lockstep.actor import LockstepActor
from aerodaas.actors.streams import Publisher
from aerodaas.actors.worker import NodeSpec, Worker
from aerodaas.runtime.session import MESSAGE_DEPTH
from aerodaas.runtime.stream_names import ACKS
from aerodaas.types.clock import host_time_ns
from aerodaas.types.status import Message
from aerodaas.types.vehicle import VehicleState

__all__ = ["LockstepAnalyticsActor"]


class LockstepAnalyticsActor(LockstepActor, AnalyticsActor):
    """Analytics actor for which mission time waits."""

    def acknowledge(self, streams: dict[str, bool]) -> None:
        """Set whether the analyses of these streams acknowledge their items."""
        for worker in self._workers:
            if isinstance(worker, _LockstepWorker) and worker.node.stream in streams:
                worker.acknowledge(wanted=streams[worker.node.stream])

    def _worker(self, node: NodeSpec) -> Worker:
        return _LockstepWorker(self, node)


class _LockstepWorker(Worker):
    """Worker whose time is that of the messages."""

    state_depth = MESSAGE_DEPTH
    _at = 0
    """Mission time of the message in process: that of its measurement, or later where a simulated
    execution made it."""

    def open(self) -> None:
        super().open()
        self.acknowledge(wanted=self.node.acknowledges)

    def acknowledge(self, *, wanted: bool) -> None:
        """Start or stop to acknowledge processed items."""
        stream = f"{ACKS}/{self.node.stream}"
        known = self._actor.publishers.get(stream)
        self._acks: Publisher | None = None
        if wanted:
            self._acks = known or self._actor.publisher(stream)

    def vehicle(self) -> VehicleState | None:
        """The newest vehicle state at the message's own time; None before the first."""
        states = reversed(self._states)
        return next((state for at, state in states if at <= self._at), None)

    def _produce(self, stamp: int) -> None:
        self._at = stamp
        super()._produce(stamp)

    def _work(self, message: Message[Any]) -> None:
        self._at = message.stamp
        super()._work(message)

    def _run_external(self) -> None:
        """Measure at the timestamps of the drone's states."""
        for message in self._receive(0.5):
            due = self._actor.session.is_due(self.node.stream, self._rate, message.stamp)
            if message.stream == self.node.state and due:
                self._produce(message.stamp)

    def _arrived(self, timeout: float) -> list[Message[Any]]:
        messages = super()._arrived(timeout)
        # A state is published before the measurements made in it, but may arrive in between.
        return messages + super()._arrived(0.0) if messages else messages

    def _processed(self, message: Message[Any]) -> None:
        if self._acks is not None:
            done = ((message.header.source, message.header.stamp),)
            self._acks.derive(done, message, host_time_ns(), message.stamp)

    def _stamp(self, message: Message[Any]) -> int:
        return message.stamp
