"""Connection to Ray: starting a local one, joining a cluster, and placing actors on nodes."""

from __future__ import annotations

import atexit
import logging
import os
import re
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import ray
from ray.exceptions import RuntimeEnvSetupError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from aerodaas.actors.cluster.handshake import greet, hushed, kept_address, listener_of, reach
from aerodaas.actors.cluster.head_watch import answers
from aerodaas.actors.cluster.local_ray import LOOPBACK, LocalRay
from aerodaas.config.model import ComputeConfig
from aerodaas.errors import AeroDaaSError, ConfigError
from aerodaas.runtime.placement import Placement

__all__ = [
    "begin",
    "brings",
    "connect",
    "disconnect",
    "discover",
    "hardware",
    "home_edge",
    "join",
    "nodes_at",
    "options_for",
    "pinned",
]

_KINDS: tuple[Literal["edge", "cloud"], ...] = ("edge", "cloud")
_ACCELERATORS = {"GPU", "TPU", "NPU", "HPU", "neuron_cores"}
"""Ray's resource names of accelerators (docs.ray.io, "Accelerator Support")."""
_ACCELERATOR_TYPE = "accelerator_type:"
"""Prefix of the resource by which Ray tells an accelerator's product name."""
_SHARE = 0.001
"""Amount of a node's `edge` or `cloud` resource per actor, for placement only."""
_VERSIONS = re.compile(r"Ray: (\S+)\s+Python: (\S+)")
"""What Ray says of the head's and this machine's versions where they differ."""
_PYTHON_MATCH = "RAY_DEFAULT_PYTHON_VERSION_MATCH_LEVEL"
_NAMESPACE = "aerodaas"
"""Ray namespace for the names of actors that outlive their application."""

_local: LocalRay | None = None
"""Local Ray started by this process, if any."""
_brought: dict[Path, tuple[int, ...]] = {}
"""Files and folders of the modules of this process' job, as they were when it was joined."""


def begin(address: str | None) -> None:
    """Start a local Ray in the background if `connect` will need one; returns at once."""
    global _local  # noqa: PLW0603 - one Ray for each process
    if ray.is_initialized() or address or os.environ.get("RAY_ADDRESS") or _local is not None:
        return
    _local = LocalRay()
    atexit.register(disconnect)


def connect(
    address: str | None,
    begin_step: Callable[[str], None] = lambda _: None,
    modules: Sequence[Path] = (),
) -> None:
    """Start a local Ray on this machine, or join a cluster; nothing where that was done before.

    Args:
        address: The cluster's `host:port`; None for that of `RAY_ADDRESS`, or for a local Ray.
        begin_step: Called with the name of the step that follows, which may take a minute.
        modules: Files and folders of the modules that all processes of this one's job import.

    Raises:
        AeroDaaSError: If the cluster cannot be reached or Ray does not start.
        ConfigError: If the cluster offers no edge node.
    """
    if ray.is_initialized():
        return
    address = address or os.environ.get("RAY_ADDRESS")
    begin_step(f"joining the Ray cluster at {address}" if address else "starting Ray")
    if address:
        join(address, modules)
        _require_edge(address)
        return
    begin(None)
    assert _local is not None  # noqa: S101 - begun
    _init(_local.address, [one for one in modules if not _on_path(one)])
    addresses = {node["NodeManagerAddress"] for node in ray.nodes()}
    if addresses != {LOOPBACK}:
        warnings.warn(
            f"Ray {ray.__version__} listens on all interfaces of this machine, at "
            f"{', '.join(addresses)}: it does not take the loopback address; its token keeps "
            "others out",
            stacklevel=2,
        )


def join(address: str, modules: Sequence[Path] = ()) -> None:
    """Join the cluster at `address`, without a check of its nodes.

    Args:
        address: Address of the cluster.
        modules: Those that `connect` takes.

    Raises:
        AeroDaaSError: If the cluster cannot be reached or joined.
    """
    if ray.is_initialized():
        return
    reach(address)
    _init(address, modules)


def brings(name: str, path: Path) -> bool:
    """Whether the actors of this process can import a module.

    Args:
        name: The module's name.
        path: Its file or folder.

    Returns:
        False for a module that Ray cannot bring along, because its file has another name, or
        because it is not as it was when this process joined Ray, or was not there then.
    """
    if path.name not in {name, f"{name}.py"}:
        return False
    if not ray.is_initialized() or (_local is not None and _on_path(path)):
        return True
    return _brought.get(path) == _state_of(path)


def _on_path(path: Path) -> bool:
    """Whether processes that this one starts find the module at `path` by themselves."""
    return str(path.parent) in os.environ.get("PYTHONPATH", "").split(os.pathsep)


def _state_of(path: Path) -> tuple[int, ...]:
    files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
    return tuple(number for file in files for number in (file.stat().st_mtime_ns,))


def _init(address: str, modules: Sequence[Path]) -> None:
    # Errors are raised where they belong to a call, and reported as alerts where they do not.
    quiet: dict[str, Any] = {"logging_level": logging.CRITICAL, "log_to_driver": False}
    try:
        with hushed():
            ray.init(
                address=kept_address(address),
                namespace=_NAMESPACE,
                runtime_env={"py_modules": [*map(str, modules)]} if modules else None,
                **quiet,
            )
    except ConnectionError as error:
        greet(address)
        raise _unreachable(address, str(error).strip().splitlines()[0]) from None
    except (RuntimeError, ValueError) as error:
        raise _other_versions(address, str(error)) from None
    except RuntimeEnvSetupError as error:
        raise AeroDaaSError(f"the application's own modules cannot be sent: {error}") from None
    _brought.clear()
    _brought.update({path: _state_of(path) for path in modules})


def _other_versions(address: str, reason: str) -> AeroDaaSError:
    """Error of a head that runs another Ray or Python, of which Ray tells by `reason`."""
    found = _VERSIONS.findall(reason)
    if len(found) != 2:  # noqa: PLR2004 - the head's and ours
        return _unreachable(address, reason.strip().splitlines()[0])
    head, here = found
    if head[0] != here[0]:
        return AeroDaaSError(
            f"the head at {address} runs Ray {head[0]}, this machine {here[0]}; install the same "
            f"on both: pip install 'ray=={head[0]}'"
        )
    theirs, ours = (".".join(version.split(".")[:2]) for version in (head[1], here[1]))
    remedy = f"{theirs} here" if theirs != ours else f"{head[1]} here, or set {_PYTHON_MATCH}=minor"
    return AeroDaaSError(
        f"the head at {address} runs Python {head[1]}, this machine {here[1]}; use Python {remedy}"
    )


def _unreachable(address: str, reason: str) -> AeroDaaSError:
    return AeroDaaSError(
        f"cannot join the Ray cluster at {address}: {reason}; "
        "check the address and that the head runs the same Ray and Python versions"
    )


def _require_edge(address: str) -> None:
    if not any("edge" in node["Resources"] for node in ray.nodes() if node["Alive"]):
        ray.shutdown()
        raise ConfigError(
            f"the Ray cluster at {address} has no edge node; start the one beside the drone "
            """with `ray start --address … --resources '{"edge": 1}'`"""
        )


def disconnect() -> None:
    """Leave Ray; a local one ends at once or after the last drone has landed."""
    global _local
    local, _local = _local, None
    if local is None:
        ray.shutdown()
        return
    atexit.unregister(disconnect)
    ends = [ray.shutdown, local.end]
    listener = listener_of(local.address) if ray.is_initialized() else None
    if listener is not None and not answers(listener):
        # Ray waits without end for a head that hangs, but not for one that has ended.
        ends.reverse()
    for end in ends:
        end()


def discover() -> list[ComputeConfig]:
    """Compute resources of the connected cluster: one for each kind of node."""
    found: dict[str, ComputeConfig] = {}
    for node in ray.nodes():
        for kind in _KINDS:
            if node["Alive"] and kind in node["Resources"]:
                found[kind] = ComputeConfig(id=kind, kind=kind)
    return list(found.values())


def nodes_at(place: Placement) -> list[dict[str, Any]]:
    """Live nodes that match `place`, as described by Ray.

    Raises ConfigError if there are none, or if the named one is not of this kind.
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


def hardware(place: Placement) -> dict[str, Any]:
    """Number of the nodes at `place`, and the sums of their cores, memory and accelerators.

    Raises ConfigError if there are none.
    """
    nodes = nodes_at(place)
    total: Counter[str] = Counter()
    for node in nodes:
        total.update(node["Resources"])
    return {
        "nodes": len(nodes),
        "cores": total["CPU"],
        "memory": int(total["memory"]),
        "accelerators": {
            name.removeprefix(_ACCELERATOR_TYPE): number
            for name, number in total.items()
            if name in _ACCELERATORS or name.startswith(_ACCELERATOR_TYPE)
        },
    }


def _names(node: dict[str, Any]) -> set[str]:
    """Names of a node in environment files: address, name, host name and id."""
    keys = ("NodeManagerAddress", "NodeName", "NodeManagerHostname", "NodeID")
    return {node[key] for key in keys if key in node}


def _label(node: dict[str, Any]) -> str:
    address: str = node["NodeManagerAddress"]
    name: str = node.get("NodeName", address)
    return address if name == address else f"{name} ({address})"


def home_edge() -> str:
    """Id of the edge node for the drones if the environment file names none.

    This process' own node if it is an edge node, else the first one. Raises ConfigError if there
    is none.
    """
    offered = sorted(node["NodeID"] for node in nodes_at(Placement()))
    here: str = ray.get_runtime_context().get_node_id()
    return here if here in offered else offered[0]


def options_for(place: Placement, *, restarts: int) -> dict[str, Any]:
    """Ray's options for an actor at `place`.

    Args:
        place: Kind of node, or one node.
        restarts: How often Ray starts it again after its death.

    Raises:
        ConfigError: If no node of the cluster fits.
    """
    nodes = nodes_at(place)
    options: dict[str, Any] = {
        "num_cpus": 0,
        "resources": {place.kind: _SHARE},
        "max_restarts": restarts,
        # The head would keep the history of each call, 3 kB of memory a call, for a dashboard.
        "enable_task_events": False,
    }
    if place.node is not None:
        address = nodes[0]["NodeManagerAddress"]
        neighbours = [n for n in ray.nodes() if n["Alive"] and n["NodeManagerAddress"] == address]
        if len(neighbours) == 1:
            # By its address, so that a restarted node matches again.
            options["resources"][f"node:{address}"] = _SHARE
        else:
            options["scheduling_strategy"] = pinned(nodes[0]["NodeID"])
    elif place.kind == "edge":
        # All edge actors of a run share one node, even if there are several edge nodes.
        options["scheduling_strategy"] = pinned(home_edge())
    return options


def pinned(node_id: str) -> NodeAffinitySchedulingStrategy:
    """Ray scheduling strategy that requires this node."""
    return NodeAffinitySchedulingStrategy(node_id, soft=False)
