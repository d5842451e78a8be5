"""`aerodaas cluster check`: a cluster's resources and links, and problems with remedies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from aerodaas.actors.cluster import ray_cluster as cluster
from aerodaas.actors.cluster.probe import LinkMeasurement, NodeFacts, Probe
from aerodaas.findings import Finding

__all__ = ["check_cluster"]

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
