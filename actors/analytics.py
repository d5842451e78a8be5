"""Analytics actor: runs one or several analyses, each in a thread of its own.

Light analyses share an actor, because an actor costs 70 MB; an `isolated` one, such as a neural
network, has its own.
"""

from __future__ import annotations

import math
import threading
import time
from typing import Any

from aerodaas.actors.base import ActorInfo, StreamActor
from aerodaas.actors.process_variables import ProcessVariables
from aerodaas.actors.worker import NodeSpec, Worker
from aerodaas.runtime.reports import StreamCount
from aerodaas.runtime.session import Session

__all__ = ["AnalyticsActor"]

_LOOK_INTERVAL = 1.0
_PARTING = 3.0
"""Wall seconds that an analysis has to finish its item after the end of the run."""


class AnalyticsActor(StreamActor):
    """Actor that runs the analyses passed to `prepare`."""

    def _worker(self, node: NodeSpec) -> Worker:
        return Worker(self, node)

    def __init__(self, session: Session, name: str) -> None:
        """Create the actor `name` of `session`."""
        super().__init__(session, name, {})
        self._workers: list[Worker] = []
        self._threads: list[threading.Thread] = []

    def prepare(self, variables: ProcessVariables | None = None, *nodes: NodeSpec) -> ActorInfo:
        """Open the analyses `nodes`; raises the exceptions of their `open`.

        `variables` have been set in this process by their arrival.
        """
        del variables
        # Not in the constructor: Ray would keep the models in its object store for restarts.
        self._workers = [self._worker(node) for node in nodes]
        return super().prepare()

    def join(self, *nodes: NodeSpec) -> ActorInfo:
        """Run further analyses in flight; none of them if the `open` of one raises."""
        fresh = [self._worker(node) for node in nodes]
        before = set(self.publishers)
        try:
            for worker in fresh:
                worker.open()
        except BaseException:
            for worker in fresh:
                worker.close()
            for stream in set(self.publishers) - before:
                self.publishers.pop(stream).close()
            raise
        self._workers += fresh
        for worker in fresh:
            self._begin(worker)
        return self.info()

    def _open(self) -> None:
        for worker in self._workers:
            worker.open()

    def _begin(self, worker: Worker) -> None:
        thread = threading.Thread(target=worker.run, name=worker.node.stream, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _run(self) -> None:
        for worker in self._workers:
            self._begin(worker)
        given_up = math.inf
        while any(one.is_alive() for one in self._threads) and time.monotonic() < given_up:
            if self.stopping:
                given_up = min(given_up, time.monotonic() + _PARTING)
            for thread in tuple(self._threads):
                thread.join(_LOOK_INTERVAL / len(self._threads))
            for worker in self._workers:
                worker.look_after()

    def _close(self) -> None:
        for worker in self._workers:
            worker.close()

    def deliver(self, stream: str, data: bytes) -> None:
        """Deliver a message from another node to every analysis that reads it."""
        for worker in self._workers:
            if stream in worker.subscriber.received:
                worker.subscriber.deliver(stream, data)

    def stop(self) -> Any:  # noqa: ANN401 - the base's report
        """Finish current items, close everything, and return the final report."""
        self._stopping.set()
        for worker in self._workers:
            worker.wake()
        return super().stop()

    def reads(self) -> list[str]:
        """Names of the streams that this actor's analyses read."""
        return sorted({stream for worker in self._workers for stream in worker.depths})

    def counts(self) -> dict[str, StreamCount]:
        """Messages received and dropped by each analysis, by `stream>analysis`."""
        return {
            f"{stream}>{worker.node.stream}": StreamCount(
                worker.subscriber.received[stream], worker.subscriber.dropped[stream]
            )
            for worker in self._workers
            if worker.opened
            for stream in worker.node.inputs
        }

    def _values(self) -> dict[str, Any]:
        return {
            "busy_seconds": {worker.node.stream: worker.busy for worker in self._workers},
            "errors": {w.node.stream: w.errors for w in self._workers if w.errors},
            "last_errors": [w.last_error for w in self._workers if w.last_error],
        }
