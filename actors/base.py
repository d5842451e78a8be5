"""Node actor: runs nodes in threads of one process, connected to other actors by streams.

The application's process creates all actors at once, then calls on each `prepare` (make and open
the nodes, join the streams), `start` (run each node in a thread of its own), any number of
`report`, and `stop`. An actor restarted by Ray gets the mission's time, by `set_origin`, and begins
again with `prepare`.
"""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import ray

from aerodaas.actors.cluster.dead_man import exit_actor, exit_soon
from aerodaas.actors.node_runner import NodeRunner
from aerodaas.actors.priority import be_nice
from aerodaas.actors.process_variables import ProcessVariables
from aerodaas.actors.streams import UNDER_WAY, Publisher, RemoteReader, Subscriber
from aerodaas.clock import host_time_ns
from aerodaas.errors import AeroDaaSError, as_project_error
from aerodaas.messages.envelope import Message
from aerodaas.messages.vitals import read_vitals
from aerodaas.runtime.node import Node
from aerodaas.runtime.reports import (
    ActorReport,
    AlertHandler,
    AlertLog,
    Phase,
    SentCount,
    StreamCount,
    merged_values,
    sent_counts,
)
from aerodaas.runtime.session import Session

__all__ = ["ActorInfo", "NodeActor", "NodeMaker"]

_PROBLEMS_KEPT = 50
_LOOK_INTERVAL = 1.0
"""Wall seconds between two looks at nodes that may hang."""
_PARTING = 3.0
"""Wall seconds that a node has to finish its step after the end of the run."""


class NodeMaker(Protocol):
    """Specification of a node, sent to the actor that runs it."""

    @property
    def niceness(self) -> int:
        """Niceness of a process that runs the node."""
        ...

    def make(self, session: Session) -> Node:
        """Make the node in the actor's process."""
        ...


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


class NodeActor:
    """Actor that runs the nodes of the specifications passed to `prepare`."""

    niceness = 0
    """Niceness of a process without such specifications."""

    def __init__(self, session: Session, name: str) -> None:
        """Create the actor `name` of `session`."""
        self.session = session
        self.name = name
        self.clock = session.clock()
        self.runners: list[NodeRunner] = []
        self.publishers: dict[str, Publisher] = {}
        self.alerts = AlertLog(name)
        self._phase: Phase = "new"
        self._error: AeroDaaSError | None = None
        self._started = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        # Reentrant: sending an alert may raise another one, if it turns out unsendable.
        self._alerting = threading.RLock()
        self._problems: list[str] = []

    def prepare(self, variables: ProcessVariables | None = None, *specs: NodeMaker) -> ActorInfo:
        """Make and open the nodes of `specs`.

        Args:
            variables: Set in this process by their arrival.
            *specs: Makers of the nodes.

        Raises:
            Exception: What the opening of a node raises.
        """
        del variables
        be_nice(min((spec.niceness for spec in specs), default=self.niceness))
        logging.captureWarnings(capture=True)
        logging.getLogger("aerodaas").addHandler(AlertHandler(self.alert))
        self.publisher(self.alerts.outlet.stream, f"{self.name}'s alert")
        # Not in the constructor: Ray would keep the models in its object store for restarts.
        self._open(specs)
        self._phase = "ready"
        return self.info()

    def _open(self, specs: tuple[NodeMaker, ...]) -> None:
        """Make and open nodes; closes them if the opening of one raises."""
        self.runners = [self._runner(spec.make(self.session)) for spec in specs]
        try:
            for runner in self.runners:
                runner.open([one.node for one in self.runners])
        except BaseException:
            for runner in self.runners:
                runner.close()
            raise

    def _runner(self, node: Node) -> NodeRunner:
        actor: Any = self  # whose module type checkers know by two names, for its folder is linked
        return NodeRunner(actor, node)

    def info(self) -> ActorInfo:
        """Node, process and streams of the actor."""
        return ActorInfo(
            ray.get_runtime_context().get_node_id(),
            os.getpid(),
            any(runner.subscriber.shared for runner in self.runners if runner.opened),
            tuple(self.publishers),
            tuple(self.reads()),
            host_time_ns(),
        )

    def connect(self, readers: dict[str, list[Any]]) -> None:
        """Set the actors on other nodes that read this actor's streams."""
        for stream, actors in readers.items():
            self.publishers[stream].remote = [RemoteReader(actor, UNDER_WAY) for actor in actors]

    def set_origin(self, origin_ns: int) -> None:
        """Count mission time from host time `origin_ns`; until then it stands at zero."""
        self.session = self.session.starting_at(origin_ns)
        self.clock = self.session.clock()

    def start(self, origin_ns: int) -> None:
        """Start the nodes; mission time is zero at host time `origin_ns`."""
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
        """Deliver a message from another node to every node of this actor that reads it.

        Args:
            stream: Name of the stream.
            data: The encoded message.
        """
        for runner in self.runners:
            if runner.opened and stream in runner.subscriber.received:
                runner.subscriber.deliver(stream, data)

    def hand_out(self, stream: str, seq: int) -> list[bytes]:
        """Encoded newest messages of a published `stream`.

        For an application on another node, or without shared memory.

        Args:
            stream: Name of the stream; one that is not published has none.
            seq: Number of the first message wanted.
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
            alerts=self.alerts.newest,
            problems=tuple(self._problems),
            values=self._values(),
        )

    def stop(self) -> ActorReport:
        """Finish current work, close everything, and return the final report.

        The process ends soon afterwards, at the latest by its own timer.
        """
        exit_soon()
        self._stopping.set()
        for runner in self.runners:
            runner.wake()
        if self._thread is not None:
            self._thread.join(timeout=10.0)
        self._close()
        report = self.report()
        for publisher in self.publishers.values():
            publisher.close()
        return report

    def resolve_address(self) -> None:
        """Do nothing: the call makes Ray resolve the actor's address for the caller."""

    def exit(self) -> None:
        """End the process; called after `stop`."""
        exit_actor()

    @property
    def scope(self) -> str:
        """Prefix of the stream names of this run on this node."""
        return self.session.scope(ray.get_runtime_context().get_node_id())

    def publisher(self, stream: str, what: str = "") -> Publisher:
        """Open a stream for writing."""

        def unsendable(reason: str) -> None:
            self._problem("unsendable", f"{what or stream}: {reason}")

        self.publishers[stream] = Publisher(self.scope, stream, unsendable)
        return self.publishers[stream]

    def reader(
        self, depths: Mapping[str, int], who: str = "", within: frozenset[str] = frozenset()
    ) -> Subscriber:
        """Open streams for reading."""

        def unreadable(reason: str) -> None:
            self._problem("unreadable", f"{who or self.name} cannot read {reason}")

        return Subscriber(self.scope, depths, unreadable, within)

    def publish(self, message: Message[Any]) -> Message[Any]:
        """Send a message to its readers in this process and in others; returns what was sent."""
        for runner in self.runners:
            if runner.opened and message.stream in runner.within:
                runner.subscriber.accept(message)
        return self.publishers[message.stream].publish(message)

    def _problem(self, kind: str, text: str) -> None:
        """Raise an alert, once, for an item that cannot be sent or read; reported at the end."""
        with self._alerting:
            if text not in self._problems and len(self._problems) < _PROBLEMS_KEPT:
                self._problems.append(text)
                self.alert(kind, text)

    def alert(self, kind: str, text: str) -> None:
        """Publish an alert at the current mission time; thread-safe."""
        self.publish_alert(kind, text, self.clock.now(), {})

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str = ""
    ) -> None:
        """Publish an alert; thread-safe.

        An alert of the same source with the same text within the last seconds is suppressed.
        """
        with self._alerting:
            message = self.alerts.message(kind, text, stamp, values, source)
            if message is not None and self.publish(message).item is None:
                # Its figures cannot be sent: the words can.
                plain = replace(message.item, values={}) if message.item else None
                again = self.alerts.outlet.measure(plain, message.header, host_time_ns())
                self.publish(again)

    def publish_application_alert(self, kind: str, text: str) -> None:
        """Publish an alert of the application's process, so that it is recorded.

        Args:
            kind: Short machine-readable name.
            text: One sentence for the operator.
        """
        self.alert(kind, text)

    def reads(self) -> list[str]:
        """Names of the streams that this actor reads from others."""
        streams = {
            stream
            for runner in self.runners
            for stream in runner.node.reads
            if stream not in runner.within
        }
        return sorted(streams)

    def counts(self) -> dict[str, StreamCount]:
        """Messages received and dropped by each node, by `stream>node`."""
        return {
            f"{stream}>{runner.node.name}": count
            for runner in self.runners
            if runner.opened
            for stream, count in runner.counts().items()
        }

    def sent(self) -> dict[str, SentCount]:
        """Messages published, by stream."""
        return sent_counts(self.alerts.outlet, (runner.node for runner in self.runners))

    @property
    def stopping(self) -> bool:
        """True after `stop` was called."""
        return self._stopping.is_set()

    def rest(self, seconds: float) -> None:
        """Wait for so many wall seconds, or until the actor is stopped."""
        self._stopping.wait(seconds)

    def _guard(self) -> None:
        try:
            self._run()
        except Exception as error:  # noqa: BLE001 - a plug-in may raise any exception
            self.fail(error)
        else:
            if self._phase != "failed":
                self._phase = "done"

    def fail(self, error: Exception) -> None:
        """End as failed, with an alert; called in the thread of a node whose step raised."""
        error = as_project_error(self.name, error)
        self._error = self._error or error
        self._phase = "failed"
        self.alert("actor_failed", str(error))

    def _run(self) -> None:
        """Run each node in a thread; watch for those that hang until all have ended."""
        threads = [runner.start_thread() for runner in self.runners]
        given_up = math.inf
        while any(one.is_alive() for one in threads) and time.monotonic() < given_up:
            if self.stopping:
                given_up = min(given_up, time.monotonic() + _PARTING)
            for thread in threads:
                thread.join(_LOOK_INTERVAL / len(threads))
            for runner in self.runners:
                runner.watch()

    def _close(self) -> None:
        """Close the nodes; what closing one raises becomes the actor's error."""
        for runner in self.runners:
            runner.finish()
            error = runner.close()
            self._error = self._error or error

    def _values(self) -> dict[str, Any]:
        return merged_values(runner.node for runner in self.runners)
