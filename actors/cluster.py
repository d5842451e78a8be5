"""Ray itself: start it here, or join a cluster, and find places for actors."""

from __future__ import annotations

import contextlib
import logging
import os
from dataclasses import dataclass
from typing import Any, Literal

import ray
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from aerodaas.actors.greeting import greet
from aerodaas.actors.ray_variables import VARIABLES
from aerodaas.config import ComputeConfig
from aerodaas.errors import AeroDaaSError, ConfigError

__all__ = [
    "Place",
    "connect",
    "disconnect",
    "discover",
    "home_edge",
    "join",
    "nodes_at",
    "options_for",
    "outlives_application",
    "pinned",
]

_KINDS: tuple[Literal["edge", "cloud"], ...] = ("edge", "cloud")
_SHARE = 0.001
"""Share of a node's `edge` or `cloud` resource that an actor takes: it says where, not how much."""
_NAMESPACE = "aerodaas"
"""Ray's, for the names of actors that outlive their application."""
_STORE_BYTES = 128 * 2**20
"""Object store of a one-machine run; its streams travel in shared memory of their own."""


_ours = False
"""Whether this process started the Ray that it is connected to."""


@dataclass(frozen=True)
class Place:
    """Where an actor belongs."""

    kind: Literal["edge", "cloud"] = "edge"
    node: str | None = None
    """IP address of one node, where the kind alone does not say."""


def connect(address: str | None) -> None:
    """Start Ray on this machine, or join the cluster at `address` (or `RAY_ADDRESS`).

    Raises AeroDaaSError if the cluster cannot be reached, ConfigError if it offers no edge node.
    """
    global _ours  # noqa: PLW0603 - one Ray for each process
    if ray.is_initialized():
        return
    _ours = False
    address = address or os.environ.get("RAY_ADDRESS")
    if address:
        join(address)
        _require_edge(address)
        return
    common = _settings()
    # "local": else Ray joins whatever cluster someone has started on this machine.
    ray.init(
        address="local",
        num_cpus=os.cpu_count(),
        include_dashboard=False,
        object_store_memory=_STORE_BYTES,
        resources={"edge": 1, "cloud": 1},
        **common,
    )
    _ours = True
    _trim()


def join(address: str) -> None:
    """Join the cluster at `address`, whatever its nodes offer; AeroDaaSError if that fails."""
    if ray.is_initialized():
        return
    common = _settings()
    greet(address)
    try:
        ray.init(address=address, **common)
    except (ConnectionError, RuntimeError, ValueError) as error:
        reason = str(error).strip().splitlines()[0]
        raise _unreachable(address, reason) from None


def _settings() -> dict[str, Any]:
    """How quiet Ray is to be."""
    for name, value in VARIABLES.items():
        os.environ.setdefault(name, value)
    # The first error is told; Ray would print the tracebacks of those that followed.
    os.environ.setdefault("RAY_IGNORE_UNHANDLED_ERRORS", "1")
    return {"logging_level": logging.ERROR, "log_to_driver": False, "namespace": _NAMESPACE}


def _unreachable(address: str, reason: str) -> AeroDaaSError:
    return AeroDaaSError(
        f"cannot join the Ray cluster at {address}: {reason}; "
        "check the address and that the head runs the same Ray and Python versions"
    )


def _trim() -> None:
    """Stop what a one-machine run of ours has no use for: 150 MB of autoscaler, log and web.

    Ray offers no switch for it, so a Ray that hides these processes elsewhere keeps them.
    """
    node = getattr(ray._private.worker, "_global_node", None)  # noqa: SLF001
    for name in ("kill_monitor", "kill_log_monitor", "kill_dashboard"):
        with contextlib.suppress(Exception):
            getattr(node, name)(check_alive=False)


def _require_edge(address: str) -> None:
    if not any("edge" in node["Resources"] for node in ray.nodes() if node["Alive"]):
        ray.shutdown()
        raise ConfigError(
            f"the Ray cluster at {address} has no edge node; start the one beside the drone "
            """with `ray start --address … --resources '{"edge": 1}'`"""
        )


def outlives_application() -> bool:
    """Tell whether the connected Ray goes on when this process dies: nobody here started it."""
    return not _ours


def disconnect() -> None:
    """Leave the cluster; a Ray that `connect` started ends with all its processes."""
    ray.shutdown()


def discover() -> list[ComputeConfig]:
    """The compute resources that the connected cluster offers: one for each kind of node."""
    found: dict[str, ComputeConfig] = {}
    for node in ray.nodes():
        for kind in _KINDS:
            if node["Alive"] and kind in node["Resources"]:
                found[kind] = ComputeConfig(id=kind, kind=kind)
    return list(found.values())


def nodes_at(place: Place) -> list[dict[str, Any]]:
    """The living nodes that `place` may mean, as Ray describes them.

    Raises ConfigError if there are none, or if Ray does not know the named one as this kind.
    """
    alive = [node for node in ray.nodes() if node["Alive"]]
    kind = [node for node in alive if place.kind in node["Resources"]]
    if place.node is None:
        if not kind:
            raise ConfigError(
                f"no node of the cluster offers {place.kind!r}; start one with "
                f"`ray start --address … --resources '{{\"{place.kind}\": 1}}'`"
            )
        return kind
    named = [node for node in alive if place.node in _names(node)]
    if not named:
        known = ", ".join(sorted({_label(node) for node in alive}))
        raise ConfigError(f"no node of the cluster is called {place.node!r}; known: {known}")
    if not any(node in kind for node in named):
        raise ConfigError(
            f"the node {place.node!r} does not offer {place.kind!r}; start it with "
            f"`--resources '{{\"{place.kind}\": 1}}'`, or correct the resource's kind"
        )
    return [node for node in named if node in kind]


def _names(node: dict[str, Any]) -> set[str]:
    """How an environment file may call a node: by address, name, host name or id."""
    keys = ("NodeManagerAddress", "NodeName", "NodeManagerHostname", "NodeID")
    return {node[key] for key in keys if key in node}


def _label(node: dict[str, Any]) -> str:
    address: str = node["NodeManagerAddress"]
    name: str = node.get("NodeName", address)
    return address if name == address else f"{name} ({address})"


def home_edge() -> str:
    """Id of the edge node beside the drones where the environment file names none.

    This process' own node if it is one, else the first. Raises ConfigError if there is none.
    """
    offered = sorted(node["NodeID"] for node in nodes_at(Place()))
    here: str = ray.get_runtime_context().get_node_id()
    return here if here in offered else offered[0]


def options_for(place: Place, *, restarts: int) -> dict[str, Any]:
    """Ray's options for an actor at `place`.

    Raises ConfigError if no node of the cluster fits.
    """
    nodes = nodes_at(place)
    options: dict[str, Any] = {
        "num_cpus": 0,
        "resources": {place.kind: _SHARE},
        "max_restarts": restarts,
    }
    if place.node is not None:
        address = nodes[0]["NodeManagerAddress"]
        neighbours = [n for n in ray.nodes() if n["Alive"] and n["NodeManagerAddress"] == address]
        if len(neighbours) == 1:
            # By its address, so that a node that was restarted is known again.
            options["resources"][f"node:{address}"] = _SHARE
        else:
            options["scheduling_strategy"] = pinned(nodes[0]["NodeID"])
    elif place.kind == "edge":
        # All that is beside the drones is beside each other, however many edges there are.
        options["scheduling_strategy"] = pinned(home_edge())
    return options


def pinned(node_id: str) -> NodeAffinitySchedulingStrategy:
    """Ray's strategy of running on this node or nowhere."""
    return NodeAffinitySchedulingStrategy(node_id, soft=False)
