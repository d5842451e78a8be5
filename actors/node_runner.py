"""Runner of one node in an actor: receives its messages, steps it, publishes what it returns."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from aerodaas.actors.streams import Subscriber
from aerodaas.cameras.base import most_memory
from aerodaas.errors import AeroDaaSError, as_project_error
from aerodaas.messages.envelope import Message
from aerodaas.runtime.memory_limit import limit_memory
from aerodaas.runtime.node import NEVER, Host, Node
from aerodaas.runtime.nodes.analysis import AnalysisNode
from aerodaas.runtime.nodes.camera import CameraNode
from aerodaas.runtime.reports import StreamCount

if TYPE_CHECKING:
    from aerodaas.actors.base import NodeActor

__all__ = ["NodeRunner"]

_LONGEST_WAIT = 0.5
"""Wall seconds of one wait for messages, after which a stop is noticed."""
_HUNG = 5.0
"""Wall seconds on one item before an alert; a first inference may take several."""


class NodeRunner(Host):
    """One node, its subscriber and its publishers; the node's host."""

    def __init__(self, actor: NodeActor, node: Node) -> None:
        """Run `node` in `actor`."""
        self.node = node
        self.within: frozenset[str] = frozenset()
        """Streams that the node reads from nodes of the same actor."""
        self._actor = actor
        self._who = type(node.spec.work).__name__ if isinstance(node, AnalysisNode) else ""
        """Name in alerts of items that it cannot read or send."""
        self._subscriber: Subscriber | None = None
        self._hung_since: float | None = None

    @property
    def subscriber(self) -> Subscriber:
        """Subscriber of the node's streams, once it is opened."""
        assert self._subscriber is not None  # noqa: S101 - opened
        return self._subscriber

    @property
    def opened(self) -> bool:
        """Whether `open` has subscribed."""
        return self._subscriber is not None

    # Host of the node.

    def now(self) -> int:
        """Mission time, nanoseconds."""
        return self._actor.clock.now()

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str
    ) -> None:
        """Publish an alert by the actor."""
        self._actor.publish_alert(kind, text, stamp, values, source)

    def wake(self) -> None:
        """End a wait for messages; thread-safe."""
        if self._subscriber is not None:
            self._subscriber.wake()

    # Life cycle.

    def open(self, nodes: Iterable[Node]) -> None:
        """Subscribe, open the node and its streams; raises what the node's `open` raises.

        `nodes` are all of the actor, whose messages are handed over as they are.
        """
        published = {stream for node in nodes for stream in node.outlets}
        published.add(self._actor.alerts.outlet.stream)
        self.within = frozenset(published & self.node.reads.keys())
        self._subscriber = self._actor.reader(self.node.reads, self._who, self.within)
        if isinstance(self.node, CameraNode) and (most := most_memory(self.node.camera)):
            limit_memory(most)
        self.node.open(self)
        what = f"{self._who}'s result" if self._who else ""
        for stream in self.node.outlets:
            self._actor.publisher(stream, what)

    def run(self) -> None:
        """Step the node until the actor is stopped; a node that raises ends."""
        try:
            self.publish(self.node.start(self._actor.clock))
            while not self._actor.stopping:
                self.run_once()
        except Exception as error:  # noqa: BLE001 - a plug-in may raise any exception
            self._actor.fail(error)

    def run_once(self) -> None:
        """Wait for messages, or for the node's own time, and step it."""
        messages = self.receive()
        # A step without messages is a wake-up, or harmless.
        self.publish(self.node.step(self.now(), messages))

    def receive(self) -> list[Message[Any]]:
        """Messages that have arrived, or none once the node is due; waits for a limited time."""
        due, now = self.node.due, self.now()
        wait = _LONGEST_WAIT
        if due != NEVER:
            wait = min(wait, self._actor.session.host_seconds(max(0, due - now)))
        if self.node.waits_for_inputs:
            return self.subscriber.receive(wait)
        # Its streams hold the newest message until then.
        time.sleep(wait)
        return self.subscriber.receive(0.0) if self.now() >= due else []

    def publish(self, messages: Iterable[Message[Any]]) -> None:
        """Send messages of the node."""
        for message in messages:
            self._actor.publish(message)

    def counts(self) -> dict[str, StreamCount]:
        """Messages received and dropped, by stream; none of streams whose newest is enough."""
        if not self.node.waits_for_inputs:
            return {}
        received, dropped = self.subscriber.received, self.subscriber.dropped
        return {
            stream: StreamCount(received[stream], dropped[stream])
            for stream, depth in self.node.reads.items()
            if depth > 1
            or (isinstance(self.node, AnalysisNode) and stream in self.node.spec.inputs)
        }

    def watch(self) -> None:
        """Raise an alert, once per item, if an analysis is at one item for too long."""
        node = self.node
        since = node.processing_since if isinstance(node, AnalysisNode) else None
        if since is None or since == self._hung_since or time.perf_counter() - since < _HUNG:
            return
        self._hung_since = since
        text = f"{node.name} has been at one item for {_HUNG:.0f} s"
        self._actor.alert("analysis_hung", text)

    def start_thread(self) -> threading.Thread:
        """Run the node in a thread of its own."""
        thread = threading.Thread(target=self.run, name=self.node.name, daemon=True)
        thread.start()
        return thread

    def finish(self) -> None:
        """Do what is left once all nodes before it are closed."""

    def close(self) -> AeroDaaSError | None:
        """Close the node and its subscriptions; returns the error of the node's `close`."""
        try:
            self.node.close()
        except Exception as error:  # noqa: BLE001 - a plug-in may raise any exception
            return as_project_error(self.node.name, error)
        finally:
            if self._subscriber is not None:
                self._subscriber.close()
        return None
