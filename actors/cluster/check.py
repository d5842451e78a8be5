"""`aerodaas cluster check`: a cluster's resources and links, and problems with remedies."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from aerodaas.actors.cluster import ray_cluster as cluster
from aerodaas.clock import host_time_ns
from aerodaas.findings import Finding

__all__ = ["check_cluster", "clock_offset"]

_PATIENCE = 60.0
"""Seconds that a node may take to start a probe; a first import takes several."""
_CLOCKS_APART = 0.1
"""Seconds of clock offset beyond which latencies across nodes are meaningless."""
_SLOW_RTT = 0.25
_SLOW_BITS = 5e6
_KINDS = ("edge", "cloud")


def check_cluster(address: str) -> Iterator[Finding]:
    """Join the cluster at `address` and yield the findings.

    Raises AeroDaaSError or ConfigError if it cannot be joined.
    """
    cluster.connect(address)
    try:
        yield Finding("head", f"{address}, Ray {ray.__version__}")
        nodes = [node for node in ray.nodes() if node["Alive"]]
        yield from _resources(nodes)
        yield from _twins(nodes)
        probes = {node["NodeID"]: _probe(node["NodeID"]) for node in nodes}
        for node in nodes:
            yield from _node(node, probes[node["NodeID"]])
        for here in (node for node in nodes if "edge" in node["Resources"]):
            for there in nodes:
                if here is not there:
                    yield from _way(here, there, probes)
    finally:
        cluster.disconnect()


def _resources(nodes: list[dict[str, Any]]) -> Iterator[Finding]:
    offered = Counter(kind for node in nodes for kind in _KINDS if kind in node["Resources"])
    for kind in _KINDS:
        remedy = f"""start a node with `ray start --resources '{{"{kind}": 1}}'`"""
        fits = offered[kind] > 0
        yield Finding(f"{kind} nodes", str(offered[kind]), fits, "" if fits else remedy)
    for node in nodes:
        if not any(kind in node["Resources"] for kind in _KINDS):
            text = f"{_name(node)} offers neither edge nor cloud, so nothing is placed there"
            yield Finding("resources", text, ok=False, remedy="restart it with --resources")


def _twins(nodes: list[dict[str, Any]]) -> Iterator[Finding]:
    counts = Counter(_name(node) for node in nodes)
    for name, count in counts.items():
        if count > 1:
            remedy = "run `ray stop` there, then join once"
            yield Finding("nodes", f"{name} has joined {count} times", ok=False, remedy=remedy)


def _probe(node_id: str) -> Any:  # noqa: ANN401 - an actor's handle
    strategy = NodeAffinitySchedulingStrategy(node_id, soft=False)
    remote: Any = ray.remote(Probe)
    return remote.options(num_cpus=0, scheduling_strategy=strategy).remote()


def _node(node: dict[str, Any], probe: Any) -> Iterator[Finding]:  # noqa: ANN401
    try:
        facts: NodeFacts = ray.get(probe.facts.remote(), timeout=_PATIENCE)
    except GetTimeoutError:
        text = f"starts no actor within {_PATIENCE:.0f} s"
        yield Finding(_name(node), text, ok=False, remedy="look at its load, memory and link")
        return
    except RayError as error:
        text = str(error).strip().splitlines()[-1]
        remedy = f"pip install 'aerodaas=={_ours()}' in the Python that runs Ray there"
        yield Finding(_name(node), f"cannot run AeroDaaS: {text}", ok=False, remedy=remedy)
        return
    kinds = "+".join(kind for kind in _KINDS if kind in node["Resources"])
    text = (
        f"{kinds}, {facts.host}, Python {facts.python}, AeroDaaS {facts.aerodaas}, "
        f"{facts.cores} cores, {facts.memory / 2**30:.1f} GiB"
    )
    same = facts.aerodaas == _ours()
    remedy = "" if same else f"pip install 'aerodaas=={_ours()}' there; here runs {_ours()}"
    yield Finding(_name(node), text, same, remedy)


def _way(here: dict[str, Any], there: dict[str, Any], probes: dict[str, Any]) -> Iterator[Finding]:
    names = f"{_name(here)} → {_name(there)}"
    try:
        reference = probes[here["NodeID"]].measure.remote(probes[there["NodeID"]])
        way: LinkMeasurement = ray.get(reference, timeout=_PATIENCE)
    except RayError as error:
        text = str(error).strip().splitlines()[-1]
        yield Finding(names, text, ok=False, remedy="let all ports pass between the nodes")
        return
    slow = way.rtt > _SLOW_RTT or min(way.up, way.down) < _SLOW_BITS
    text = f"round trip {way.rtt * 1000:.1f} ms, {way.up / 1e6:.1f} Mbit/s there, "
    text += f"{way.down / 1e6:.1f} back"
    remedy = "frames will be late; send fewer or smaller ones, or deploy on the edge"
    yield Finding(names, text, not slow, remedy if slow else "")
    apart = abs(way.offset) - way.uncertainty > _CLOCKS_APART
    side = "ahead" if way.offset > 0 else "behind"
    text = f"{abs(way.offset) * 1000:.1f} ± {way.uncertainty * 1000:.1f} ms {side}"
    remedy = "set both clocks by NTP: `timedatectl set-ntp true`, or chrony"
    yield Finding(f"clock of {_name(there)}", text, not apart, remedy if apart else "")


def _name(node: dict[str, Any]) -> str:
    return str(node["NodeManagerAddress"])


def _ours() -> str:
    try:
        return version("aerodaas")
    except PackageNotFoundError:
        return "not installed"


_ROUND_TRIPS = 15
_BYTES = 1_000_000
_TRANSFERS = 3


@dataclass(frozen=True)
class NodeFacts:
    """Versions and resources of one node."""

    host: str
    python: str
    ray: str
    aerodaas: str
    cores: int
    memory: int
    """Memory in bytes."""


@dataclass(frozen=True)
class LinkMeasurement:
    """Measurement of the link from one node to another."""

    rtt: float
    """Median round trip of a call in seconds, Ray's overhead included."""
    offset: float
    """Seconds by which the other clock is ahead."""
    uncertainty: float
    """Error bound of the offset in seconds: half the shortest round trip."""
    up: float
    """Bits per second to the other node."""
    down: float
    """Bits per second from the other node."""


class Probe:
    """Probe actor, one per node."""

    def facts(self) -> NodeFacts:
        """Versions and resources of this node."""
        import psutil  # noqa: PLC0415 - only here

        try:
            ours = version("aerodaas")
        except PackageNotFoundError:
            ours = "not installed (aerodaas is imported from a folder)"
        memory = psutil.virtual_memory().total
        cores = os.cpu_count() or 1
        return NodeFacts(
            platform.node(), platform.python_version(), ray.__version__, ours, cores, memory
        )

    def now(self) -> int:
        """Host time of this node, nanoseconds since the epoch."""
        return host_time_ns()

    def receive(self, data: bytes) -> int:
        """Receive a transfer and return its size."""
        return len(data)

    def give(self, size: int) -> bytes:
        """Return `size` random bytes, which no link can compress."""
        return os.urandom(size)

    def measure(self, other: Any) -> LinkMeasurement:  # noqa: ANN401 - an actor's handle
        """Measure the link to another node's probe."""
        ray.get(other.now.remote())  # the first call also makes the connection
        readings = []
        for _ in range(_ROUND_TRIPS):
            sent = host_time_ns()
            theirs = ray.get(other.now.remote())
            readings.append((sent, theirs, host_time_ns()))
        offset, uncertainty = clock_offset(readings)
        rtt = statistics.median(back - sent for sent, _, back in readings) / 1e9
        data = self.give(_BYTES)
        up = max(
            self._rate(rtt, lambda: other.receive.remote(ray.put(data))) for _ in range(_TRANSFERS)
        )
        down = max(self._rate(rtt, lambda: other.give.remote(_BYTES)) for _ in range(_TRANSFERS))
        return LinkMeasurement(rtt, offset, uncertainty, up, down)

    @staticmethod
    def _rate(rtt: float, transfer: Any) -> float:  # noqa: ANN401
        began = time.perf_counter()
        ray.get(transfer())
        return _BYTES * 8 / max(1e-6, time.perf_counter() - began - rtt)


def clock_offset(readings: list[tuple[int, int, int]]) -> tuple[float, float]:
    """Seconds by which the other clock is ahead, and the error bound.

    `readings` are (sent, the other's time, received) in nanoseconds. The shortest round trip is
    the most accurate, as in NTP (RFC 5905, section 10).
    """
    sent, theirs, received = min(readings, key=lambda reading: reading[2] - reading[0])
    return (theirs - (sent + received) / 2) / 1e9, (received - sent) / 2e9
