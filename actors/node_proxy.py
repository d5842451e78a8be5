"""Node proxy: a node of a flight in simulated time that runs in an actor of its own.

An analysis whose runtime environment is not the application's needs a process of its own; on
request, every camera and analysis has one. The executor steps the proxy as it steps any node, and
waits for its answer, so that a flight is the same wherever its nodes are.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import ray

from aerodaas.actors.base import NodeMaker
from aerodaas.actors.cluster.ray_cluster import options_for
from aerodaas.actors.isolation import isolation_options
from aerodaas.actors.process_variables import ProcessVariables, private_variables
from aerodaas.actors.run.actor_state import ask
from aerodaas.clock import Clock, SimulatedClock
from aerodaas.config.model import RuntimeEnvConfig
from aerodaas.messages.envelope import Message
from aerodaas.runtime.node import Host, Node
from aerodaas.runtime.nodes.analysis import AnalysisSpec
from aerodaas.runtime.placement import Placement
from aerodaas.runtime.plan import ActorPlan, CameraSpec
from aerodaas.runtime.session import Session

__all__ = ["NodeProxy", "Proxies"]

_OPENING = 90.0
"""Wall seconds within which a node opens, its process' start included."""
_STEP = 120.0
"""Wall seconds within which a node answers a step."""


class _Alert(NamedTuple):
    kind: str
    text: str
    stamp: int
    values: Mapping[str, Any]
    source: str


class _Stepped(NamedTuple):
    """Answer to one call of a node."""

    messages: Sequence[Message[Any]]
    alerts: Sequence[_Alert]
    due: int
    values: dict[str, Any]
    reads: dict[str, int]
    outlets: tuple[str, ...]


class _NodeHostActor(Host):
    """Actor that runs one node, and serves as its host between two calls."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._now = 0
        self._alerts: list[_Alert] = []
        self._node: Node | None = None

    def open(self, variables: ProcessVariables, spec: NodeMaker) -> _Stepped:
        """Make and open the node; `variables` have been set in this process by their arrival."""
        del variables
        logging.captureWarnings(capture=True)
        self._node = spec.make(self._session)
        self._node.open(self)
        return self._answer(())

    def start(self, now: int) -> _Stepped:
        """Begin the mission at mission time `now`."""
        self._now = now
        clock = SimulatedClock()
        clock.advance_to(now)
        return self._answer(self._made.start(clock))

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> _Stepped:
        """Step the node."""
        self._now = now
        return self._answer(self._made.step(now, inputs))

    def close(self) -> _Stepped:
        """Close the node."""
        self._made.close()
        return self._answer(())

    @property
    def _made(self) -> Node:
        assert self._node is not None  # noqa: S101 - opened
        return self._node

    def _answer(self, messages: Sequence[Message[Any]]) -> _Stepped:
        alerts, self._alerts = self._alerts, []
        node = self._made
        return _Stepped(
            tuple(messages), alerts, node.due, node.values(), node.reads, tuple(node.outlets)
        )

    def now(self) -> int:
        """Mission time of the call under way."""
        return self._now

    def publish_alert(
        self, kind: str, text: str, stamp: int, values: Mapping[str, Any], source: str
    ) -> None:
        """Keep an alert for the answer to this call, or to the next one."""
        self._alerts.append(_Alert(kind, text, stamp, values, source))

    def wake(self) -> None:
        """Do nothing: what is to be published goes with the next step."""


class NodeProxy(Node):
    """A node in an actor of its own."""

    def __init__(
        self,
        session: Session,
        spec: NodeMaker,
        name: str,
        place: Placement,
        env: RuntimeEnvConfig | None = None,
    ) -> None:
        """Create the actor.

        Args:
            session: The run.
            spec: Specification of the node.
            name: Name of the node.
            place: Place of the actor.
            env: Runtime environment of the actor; None for the application's own.
        """
        super().__init__(name, {})
        options = {**options_for(place, restarts=0), **isolation_options(env, place, name)}
        remote: Any = ray.remote(_NodeHostActor)
        self._actor = remote.options(**options).remote(session)
        self._due = 0
        self._values: dict[str, Any] = {}
        variables = ProcessVariables(private_variables(env))
        # Its streams are known before it is opened, as those of any node.
        self._opened = ask(self._actor.open.remote(variables, spec), _OPENING)
        self.reads = dict(self._opened.reads)
        for stream in self._opened.outlets:
            self.outlet(stream)

    def open(self, host: Host) -> None:
        """Pass on what was told while the node was opened."""
        super().open(host)
        self._receive(self._opened)

    def start(self, clock: Clock) -> Sequence[Message[Any]]:
        """Begin the mission."""
        return self._call(self._actor.start.remote(clock.now()))

    @property
    def due(self) -> int:
        """Mission time of the node's next step without a message."""
        return self._due

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Step the node in its actor.

        Args:
            now: Mission clock, nanoseconds.
            inputs: New messages, each stream's in order.

        Raises:
            MissionError: If its process died.
        """
        return self._call(self._actor.step.remote(now, inputs))

    def close(self) -> None:
        """Close the node, and end its process."""
        try:
            self._call(self._actor.close.remote())
        finally:
            ray.kill(self._actor)

    def _call(self, reference: Any) -> Sequence[Message[Any]]:  # noqa: ANN401 - Ray's reference
        stepped: _Stepped = ask(reference, _STEP)
        self._receive(stepped)
        return stepped.messages

    def _receive(self, stepped: _Stepped) -> None:
        for alert in stepped.alerts:
            self.host.alert(*alert)
        self._due, self._values = stepped.due, stepped.values
        for message in stepped.messages:
            outlet = self.outlet(message.stream)
            outlet.sent = message.seq + 1
            outlet.latencies.append(message.latency_ns / 1e6)

    def values(self) -> dict[str, Any]:
        """Figures of the node."""
        return self._values


class Proxies:
    """Makes the proxies of a flight: of the nodes that need a process of their own, or of all."""

    def __init__(self, *, everything: bool) -> None:
        """Make proxies of every camera and analysis if `everything`."""
        self._everything = everything

    def camera(self, session: Session, camera: CameraSpec) -> Node | None:
        """Proxy of a camera; None if it runs in the application's process."""
        if not self._everything:
            return None
        return NodeProxy(session, camera, camera.stream, camera.place)

    def analysis(self, session: Session, actor: ActorPlan, spec: AnalysisSpec) -> Node | None:
        """Proxy of an analysis of `actor`; None if it runs in the application's process."""
        if not self._everything and actor.runtime_env is None:
            return None
        return NodeProxy(session, spec, spec.stream, actor.place, actor.runtime_env)
