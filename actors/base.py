"""The base of all actors: a life in four steps, a subscriber, publishers, and a report.

The driver's process creates all actors at once, then calls on each `prepare` (open models and
cameras, join the streams), `start` (run in a thread of the actor's own), any number of `report`,
and `stop`. An actor that Ray has restarted begins again with `prepare`.
"""

from __future__ import annotations

import logging
import os
import threading
import traceback
from abc import abstractmethod
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Literal

import ray

from aerodaas.actors.cluster.dead_man import exit_soon, leave
from aerodaas.actors.priority import be_nice
from aerodaas.actors.run.application import Application
from aerodaas.actors.session import Session
from aerodaas.actors.stream_names import alert_stream
from aerodaas.actors.streams import MAX_DEPTH, UNDER_WAY, Publisher, RemoteReader, Subscriber
from aerodaas.types.clock import NANOSECONDS, LockstepClock, host_time_ns
from aerodaas.types.data import Alert, Header
from aerodaas.types.errors import AeroDaaSError, MissionError
from aerodaas.types.vitals import Vitals, read_vitals

__all__ = [
    "ActorInfo",
    "ActorReport",
    "SentCount",
    "StreamActor",
    "StreamCount",
    "failure_line",
]

_ALERTS_KEPT = 50
_REPEATED = 5 * NANOSECONDS
"""Mission time within which an alert with the same text is the same alert."""
_LISTENING = 5.0
"""Wall seconds that an actor's own thread may take to turn to further streams."""
Phase = Literal["new", "ready", "running", "done", "failed"]


@dataclass(frozen=True)
class ActorInfo:
    """Where an actor lives."""

    node_id: str
    pid: int
    shared_memory: bool
    publishes: tuple[str, ...]
    reads: tuple[str, ...]
    clock: int
    """Reading of the machine's clock when the actor was ready, host time in nanoseconds."""


@dataclass(frozen=True)
class StreamCount:
    """Counts of one stream that an actor reads."""

    received: int
    dropped: int


@dataclass(frozen=True)
class SentCount:
    """Counts of one stream that an actor publishes."""

    count: int
    median_ms: float | None
    """From capture to publishing, of the newest messages; None before the first."""
    p99_ms: float | None


@dataclass(frozen=True)
class ActorReport:
    """How an actor fares."""

    phase: Phase
    error: AeroDaaSError | None = None
    streams: dict[str, StreamCount] = field(default_factory=dict)
    sent: dict[str, SentCount] = field(default_factory=dict)
    vitals: Vitals | None = None
    """Resources used by the actor's process; None before the first measurement."""
    alerts: tuple[Alert, ...] = ()
    """The newest alerts, oldest first."""
    problems: tuple[str, ...] = ()
    """Items that could not be sent or read, with the reason."""
    values: dict[str, Any] = field(default_factory=dict)
    """Figures of the actor's own."""


def failure_line(error: BaseException) -> str:
    """The text of an exception, with the file and line that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" at {os.path.basename(frames[-1].filename)}:{frames[-1].lineno}" if frames else ""  # noqa: PTH119
    try:
        said = str(error)
    except Exception:  # noqa: BLE001 - an application's class, whose text may fail, too
        said = "it cannot say why"
    return f"{type(error).__name__}: {said}{place}"


class _AlertHandler(logging.Handler):
    """Handler that publishes warnings of the project's own modules as alerts."""

    def __init__(self, actor: StreamActor) -> None:
        super().__init__(logging.WARNING)
        self._actor = actor

    def emit(self, record: logging.LogRecord) -> None:
        self._actor.alert("warning", record.getMessage())


class StreamActor:
    """Base of the actors; subclasses implement `_open`, `_run` and `_close`."""

    niceness = 10
    """Of its process; the drone's actor alone is not nice."""

    def __init__(self, session: Session, name: str, reads: dict[str, int]) -> None:
        """Belong to `session` as `name`, reading the streams `reads` with these depths."""
        self.session = session
        self.name = name
        self.clock = session.clock()
        self._reads = reads
        self._phase: Phase = "new"
        self._error: AeroDaaSError | None = None
        self._started = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._told: dict[tuple[str, str], int] = {}
        """Mission time of the newest alerts, by kind and text."""
        self._newest_alerts: deque[Alert] = deque(maxlen=_ALERTS_KEPT)
        # Reentrant: an alert may be found to be unsendable while it is sent.
        self._alerting = threading.RLock()
        self._problems: list[str] = []
        self.subscriber: Subscriber | None = None
        self.publishers: dict[str, Publisher] = {}

    def prepare(self) -> ActorInfo:
        """Open streams and devices; raises the project's errors."""
        be_nice(self.niceness)
        logging.captureWarnings(capture=True)
        logging.getLogger("aerodaas").addHandler(_AlertHandler(self))
        self.alerts = self.publisher(alert_stream(self.name), f"{self.name}'s alert")
        self.subscriber = self.reader(self.name, self._reads)
        self._open()
        self._phase = "ready"
        return self.info()

    def info(self) -> ActorInfo:
        """The actor's node and process, and the streams that it reads and publishes."""
        return ActorInfo(
            ray.get_runtime_context().get_node_id(),
            os.getpid(),
            self.subscriber is not None and self.subscriber.shared,
            tuple(self.publishers),
            tuple(self.reads()),
            host_time_ns(),
        )

    def listen(self, depths: dict[str, int]) -> ActorInfo:
        """Read further streams from now on, with these depths; returns once it does."""
        if self.subscriber is not None:
            subscribed = self.subscriber.add(depths)
            self._reads.update(depths)
            if not subscribed.wait(_LISTENING) and not self.stopping:
                raise MissionError(f"{self.name} is busy and listens to nothing new")
        return self.info()

    def learn(self, application: Application) -> None:
        """Take over classes that the application has defined since the session was made."""
        del application  # to arrive is enough

    def connect(self, readers: dict[str, list[Any]]) -> None:
        """Learn which actors on other nodes read this actor's streams."""
        # In lockstep nothing may be dropped; the barrier keeps the number under way small.
        window = MAX_DEPTH if self.session.lockstep else UNDER_WAY
        for stream, actors in readers.items():
            self.publishers[stream].remote = [RemoteReader(actor, window) for actor in actors]

    def start(self, origin_ns: int) -> None:
        """Run in a thread; mission time is zero at host time `origin_ns`."""
        self.session = self.session.starting_at(origin_ns)
        self.clock = self.session.clock()
        self._phase = "running"
        self._thread = threading.Thread(target=self._guard, name=self.name, daemon=True)
        self._thread.start()
        self._started.set()

    def await_start(self) -> None:
        """Return once the actor runs; for a lifeline."""
        self._started.wait()

    def await_stop(self) -> None:
        """Return when the actor is stopped; for a lifeline."""
        self._stopping.wait()

    def deliver(self, stream: str, data: bytes) -> None:
        """Take a message from another node."""
        if self.subscriber is not None:
            self.subscriber.deliver(stream, data)

    def hand_out(self, stream: str, seq: int) -> list[bytes]:
        """Messages of a published `stream` from number `seq` on, of the newest few, encoded.

        For an application on another node, or without shared memory.
        """
        return self.publishers[stream].since(seq) if stream in self.publishers else []

    def report(self) -> ActorReport:
        """How the actor fares."""
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
        """Finish the work under way, close everything, and return the last report.

        The process ends soon afterwards, at the latest by itself.
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
        """Let its caller learn where it lives."""

    def leave(self) -> None:
        """End the process; `stop` came first."""
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

    def reader(self, name: str, depths: dict[str, int], who: str = "") -> Subscriber:
        """Open streams for reading as `name`; `who` names this reader in alerts."""

        def unreadable(reason: str) -> None:
            self._problem("unreadable", f"{who or self.name} cannot read {reason}")

        return Subscriber(self.scope, name, depths, unreadable)

    def _problem(self, kind: str, text: str) -> None:
        """Publish a problem with an item once; the report repeats it at the end of the run."""
        with self._alerting:
            if text not in self._problems and len(self._problems) < _ALERTS_KEPT:
                self._problems.append(text)
                self.alert(kind, text)

    def alert(self, kind: str, text: str, **values: Any) -> None:  # noqa: ANN401
        """Publish an alert at the present mission time; callable from any thread."""
        self.tell(kind, text, self.clock.now(), values)

    def tell(self, kind: str, text: str, stamp: int, values: dict[str, Any]) -> None:
        """Publish an alert about mission time `stamp`; callable from any thread.

        What was told in the same words within the last seconds is not told again.
        """
        with self._alerting:
            before = self._told.get((kind, text))
            if before is not None and 0 <= stamp - before < _REPEATED:
                return
            self._told[kind, text] = stamp
            while len(self._told) > _ALERTS_KEPT:
                self._told.pop(next(iter(self._told)))
            header = Header(self.alerts.sent, stamp, self.name)
            alert = Alert(header, kind, text, values)
            if self.alerts.measure(alert, header, host_time_ns()).item is None:
                header = Header(self.alerts.sent, stamp, self.name)
                alert = Alert(header, kind, text, {})
                self.alerts.measure(alert, header, host_time_ns())
            self._newest_alerts.append(alert)

    def follow(self, stamp: int) -> None:
        """In lockstep, advance this actor's mission time to a message's; not in the conductor."""
        with self._alerting:
            if isinstance(self.clock, LockstepClock) and stamp > self.clock.now():
                self.clock.advance_to(stamp)

    def reads(self) -> list[str]:
        """Streams that this actor reads."""
        return list(self._reads)

    def counts(self) -> dict[str, StreamCount]:
        """Received and dropped messages, by stream."""
        if self.subscriber is None:
            return {}
        return {
            stream: StreamCount(received, self.subscriber.dropped[stream])
            for stream, received in list(self.subscriber.received.items())
        }

    def sent(self) -> dict[str, SentCount]:
        """Published messages, by stream."""
        return {stream: _sent(publisher) for stream, publisher in self.publishers.items()}

    @property
    def stopping(self) -> bool:
        """True once `stop` was called."""
        return self._stopping.is_set()

    def _guard(self) -> None:
        try:
            self._run()
        except AeroDaaSError as error:
            self._fail(error)
        except Exception as error:  # noqa: BLE001 - any error of a plug-in ends here
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
        """Work until `stopping`."""

    def _close(self) -> None:
        """Release what `_open` took."""

    def _values(self) -> dict[str, Any]:
        return {}


def _sent(publisher: Publisher) -> SentCount:
    newest = sorted(publisher.latencies)
    if not newest:
        return SentCount(publisher.sent, None, None)
    middle, high = newest[len(newest) // 2], newest[int(0.99 * (len(newest) - 1))]
    return SentCount(publisher.sent, middle, high)
