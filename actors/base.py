"""Base class of all actors: life cycle, subscriber, publishers, alerts and report.

The application's process creates all actors at once, then calls on each `prepare` (open models
and cameras, join the streams), `start` (run in a thread of the actor's own), any number of
`report`, and `stop`. An actor restarted by Ray begins again with `prepare`, and one that joins in
flight begins there; both get the mission's time before, by `set_origin`.
"""

from __future__ import annotations

import logging
import os
import threading
from abc import abstractmethod
from collections import deque
from dataclasses import dataclass
from typing import Any

import ray

from aerodaas.actors.cluster.dead_man import exit_soon, leave
from aerodaas.actors.priority import be_nice
from aerodaas.actors.run.application import Application
from aerodaas.actors.streams import UNDER_WAY, Publisher, RemoteReader, Subscriber
from aerodaas.runtime.reports import ActorReport, Phase, SentCount, StreamCount
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import alert_stream
from aerodaas.types.clock import NANOSECONDS, host_time_ns
from aerodaas.types.data import Alert, Header
from aerodaas.types.errors import AeroDaaSError, MissionError, failure_line
from aerodaas.types.vitals import read_vitals

__all__ = [
    "ActorInfo",
    "StreamActor",
]

_ALERTS_KEPT = 50
_REPEATED = 5 * NANOSECONDS
"""Mission time within which an alert with the same text is suppressed, nanoseconds."""
_LISTENING = 5.0
"""Wall seconds that an actor's own thread may take to subscribe to further streams."""


@dataclass(frozen=True)
class ActorInfo:
    """Node, process and streams of an actor."""

    node_id: str
    pid: int
    shared_memory: bool
    publishes: tuple[str, ...]
    reads: tuple[str, ...]
    clock: int
    """Host time of its machine when it was ready, nanoseconds."""


class _AlertHandler(logging.Handler):
    """Publishes the warnings of the project's own modules as alerts."""

    def __init__(self, actor: StreamActor) -> None:
        super().__init__(logging.WARNING)
        self._actor = actor

    def emit(self, record: logging.LogRecord) -> None:
        self._actor.alert("warning", record.getMessage())


class StreamActor:
    """Base of the actors; subclasses implement `_open`, `_run` and `_close`."""

    niceness = 10
    """Niceness of its process; only the drone's actor has the normal one."""
    most_under_way = UNDER_WAY
    """Most unanswered messages of a stream to a reader on another node; later ones are dropped."""

    def __init__(self, session: Session, name: str, reads: dict[str, int]) -> None:
        """Create the actor `name` of `session`; `reads` are queue depths by stream read."""
        self.session = session
        self.name = name
        self.clock = session.clock()
        self._reads = reads
        self._phase: Phase = "new"
        self._error: AeroDaaSError | None = None
        self._started = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._told: dict[tuple[str, str, str], int] = {}
        """Mission time of each of the newest alerts, by source, kind and text."""
        self._newest_alerts: deque[Alert] = deque(maxlen=_ALERTS_KEPT)
        # Reentrant: sending an alert may raise another one, if it turns out unsendable.
        self._alerting = threading.RLock()
        self._problems: list[str] = []
        self.subscriber: Subscriber | None = None
        self.publishers: dict[str, Publisher] = {}

    def prepare(self) -> ActorInfo:
        """Open streams, models and cameras; raises AeroDaaSError if one cannot be opened."""
        be_nice(self.niceness)
        logging.captureWarnings(capture=True)
        logging.getLogger("aerodaas").addHandler(_AlertHandler(self))
        self.alerts = self.publisher(alert_stream(self.name), f"{self.name}'s alert")
        self.subscriber = self.reader(self._reads)
        self._open()
        self._phase = "ready"
        return self.info()

    def info(self) -> ActorInfo:
        """Node, process and current streams of the actor."""
        return ActorInfo(
            ray.get_runtime_context().get_node_id(),
            os.getpid(),
            self.subscriber is not None and self.subscriber.shared,
            tuple(self.publishers),
            tuple(self.reads()),
            host_time_ns(),
        )

    def listen(self, depths: dict[str, int]) -> ActorInfo:
        """Subscribe to further streams, given with queue depths; returns once subscribed.

        Raises MissionError if the actor's thread is busy for too long.
        """
        if self.subscriber is not None:
            subscribed = self.subscriber.add(depths)
            self._reads.update(depths)
            if not subscribed.wait(_LISTENING) and not self.stopping:
                raise MissionError(f"{self.name} is busy and listens to nothing new")
        return self.info()

    def learn(self, application: Application) -> None:
        """Receive the definitions that the application has added since the session was made."""
        del application  # unpickling it is enough

    def connect(self, readers: dict[str, list[Any]]) -> None:
        """Set the actors on other nodes that read this actor's streams."""
        for stream, actors in readers.items():
            self.publishers[stream].remote = [
                RemoteReader(actor, self.most_under_way) for actor in actors
            ]

    def set_origin(self, origin_ns: int) -> None:
        """Count mission time from host time `origin_ns`; until then it stands at zero."""
        self.session = self.session.starting_at(origin_ns)
        self.clock = self.session.clock()

    def start(self, origin_ns: int) -> None:
        """Start the actor's thread; mission time is zero at host time `origin_ns`."""
        self.set_origin(origin_ns)
        self._phase = "running"
        self._thread = threading.Thread(target=self._guard, name=self.name, daemon=True)
        self._thread.start()
        self._started.set()

    def await_start(self) -> None:
        """Return once the actor runs; awaited by the liveness monitor."""
        self._started.wait()

    def await_stop(self) -> None:
        """Return when the actor is stopped; awaited by the liveness monitor."""
        self._stopping.wait()

    def deliver(self, stream: str, data: bytes) -> None:
        """Deliver a message from another node."""
        if self.subscriber is not None:
            self.subscriber.deliver(stream, data)

    def hand_out(self, stream: str, seq: int) -> list[bytes]:
        """Encoded newest messages of a published `stream`, from number `seq` on.

        For an application on another node, or without shared memory.
        """
        return self.publishers[stream].since(seq) if stream in self.publishers else []

    def report(self) -> ActorReport:
        """Current status of the actor."""
        return ActorReport(
            phase=self._phase,
            error=self._error,
            streams=self.counts(),
            sent=self.sent(),
            vitals=read_vitals(),
            alerts=tuple(self._newest_alerts),
            problems=tuple(self._problems),
            values=self._values(),
        )

    def stop(self) -> ActorReport:
        """Finish current work, close everything, and return the final report.

        The process ends soon afterwards, at the latest by its own timer.
        """
        exit_soon()
        self._stopping.set()
        if self.subscriber is not None:
            self.subscriber.wake()
        if self._thread is not None:
            self._thread.join(timeout=10.0)
        self._close()
        report = self.report()
        for publisher in self.publishers.values():
            publisher.close()
        if self.subscriber is not None:
            self.subscriber.close()
        return report

    def meet(self) -> None:
        """Do nothing: the call makes Ray resolve the actor's address for the caller."""

    def leave(self) -> None:
        """End the process; called after `stop`."""
        leave()

    @property
    def scope(self) -> str:
        """Prefix of the stream names of this run on this node."""
        return self.session.scope(ray.get_runtime_context().get_node_id())

    def publisher(self, stream: str, what: str = "") -> Publisher:
        """Open a stream for writing; `what` names its items in alerts."""

        def unsendable(reason: str) -> None:
            self._problem("unsendable", f"{what or stream}: {reason}")

        self.publishers[stream] = Publisher(self.scope, stream, unsendable)
        return self.publishers[stream]

    def reader(self, depths: dict[str, int], who: str = "") -> Subscriber:
        """Open streams for reading; `who` names this reader in alerts."""

        def unreadable(reason: str) -> None:
            self._problem("unreadable", f"{who or self.name} cannot read {reason}")

        return Subscriber(self.scope, depths, unreadable)

    def _problem(self, kind: str, text: str) -> None:
        """Raise an alert, once, for an item that cannot be sent or read; reported at the end."""
        with self._alerting:
            if text not in self._problems and len(self._problems) < _ALERTS_KEPT:
                self._problems.append(text)
                self.alert(kind, text)

    def alert(self, kind: str, text: str, **values: Any) -> None:  # noqa: ANN401
        """Publish an alert at the current mission time; thread-safe."""
        self.tell(kind, text, self.clock.now(), values)

    def tell(
        self, kind: str, text: str, stamp: int, values: dict[str, Any], source: str = ""
    ) -> None:
        """Publish an alert; thread-safe.

        An alert of the same source with the same text within the last seconds is suppressed.

        Args:
            kind: Short machine-readable name.
            text: One sentence for the operator.
            stamp: Mission time in nanoseconds.
            values: Further figures by name.
            source: Whose alert it is; empty for this actor's own.
        """
        source = source or self.name
        with self._alerting:
            before = self._told.get((source, kind, text))
            if before is not None and 0 <= stamp - before < _REPEATED:
                return
            self._told[source, kind, text] = stamp
            while len(self._told) > _ALERTS_KEPT:
                self._told.pop(next(iter(self._told)))
            header = Header(self.alerts.sent, stamp, source)
            alert = Alert(header, kind, text, values)
            if self.alerts.measure(alert, header, host_time_ns()).item is None:
                header = Header(self.alerts.sent, stamp, source)
                alert = Alert(header, kind, text, {})
                self.alerts.measure(alert, header, host_time_ns())
            self._newest_alerts.append(alert)

    def follow(self, stamp: int) -> None:
        """Note the mission time of a received message; the wall clock advances by itself."""

    def reads(self) -> list[str]:
        """Names of the streams that this actor reads."""
        return list(self._reads)

    def counts(self) -> dict[str, StreamCount]:
        """Messages received and dropped, by stream."""
        if self.subscriber is None:
            return {}
        return {
            stream: StreamCount(received, self.subscriber.dropped[stream])
            for stream, received in list(self.subscriber.received.items())
        }

    def sent(self) -> dict[str, SentCount]:
        """Messages published, by stream."""
        return {stream: _sent(publisher) for stream, publisher in self.publishers.items()}

    @property
    def stopping(self) -> bool:
        """True after `stop` was called."""
        return self._stopping.is_set()

    def _guard(self) -> None:
        try:
            self._run()
        except AeroDaaSError as error:
            self._fail(error)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise any exception
            self._fail(AeroDaaSError(f"{self.name}: {failure_line(error)}"))
        else:
            self._phase = "done"

    def _fail(self, error: AeroDaaSError) -> None:
        self._error = error
        self._phase = "failed"
        self.alert("actor_failed", str(error))

    @abstractmethod
    def _open(self) -> None:
        """Open models, cameras, publishers."""

    @abstractmethod
    def _run(self) -> None:
        """Run until `stopping`."""

    def _close(self) -> None:
        """Release the resources of `_open`."""

    def _values(self) -> dict[str, Any]:
        return {}


def _sent(publisher: Publisher) -> SentCount:
    newest = sorted(publisher.latencies)
    if not newest:
        return SentCount(publisher.sent, None, None)
    middle, high = newest[len(newest) // 2], newest[int(0.99 * (len(newest) - 1))]
    return SentCount(publisher.sent, middle, high)
