"""Cloud resources of the managed analyses: where each may run, and at what cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.analytics.base import Analytics
from aerodaas.config.model import ComputeConfig, RuntimeEnvConfig
from aerodaas.dataflow.graph import Node
from aerodaas.runtime.dispatch.frame_codec import Codec
from aerodaas.runtime.placement import Placement
from aerodaas.schedulers.analytics.base import Profile

__all__ = ["CloudProcess", "allowed", "cloud_processes", "priced", "short_name"]


@dataclass(frozen=True)
class CloudProcess:
    """One executor in the cloud: a process on a node, or a client of an endpoint."""

    site: str
    """Id of the compute resource."""
    place: Placement
    slots: int
    works: dict[str, Analytics[Any]]
    """Analyses that it can run, by stream."""
    codec: Codec
    runtime_env: RuntimeEnvConfig | None


def short_name(node: Node) -> str:
    """Name of an analysis without its robot's."""
    return node.id.rpartition("/")[2]


def allowed(node: Node, compute: Mapping[str, ComputeConfig]) -> list[ComputeConfig]:
    """Cloud resources that a scheduler may send a managed analysis to.

    The one that it is deployed on; if deployed on an edge, every cloud node, and every endpoint
    that has a model for it.

    Args:
        node: The analysis.
        compute: Resources by id.
    """
    own = compute[node.compute] if node.compute is not None else None
    if own is not None and own.kind != "edge":
        return [own]
    return [
        resource
        for resource in compute.values()
        if resource.kind == "cloud"
        or (resource.endpoint is not None and short_name(node) in resource.endpoint.models)
    ]


def cloud_processes(
    nodes: Sequence[Node],
    compute: Mapping[str, ComputeConfig],
    envs: Mapping[str, RuntimeEnvConfig | None],
) -> tuple[CloudProcess, ...]:
    """Executors for managed analyses.

    Args:
        nodes: The analyses.
        compute: Resources by id.
        envs: Environment of each analysis, by its id.

    Raises:
        GraphError: If an endpoint cannot perform an analysis.
    """
    found = []
    for resource in compute.values():
        mine = [node for node in nodes if resource in allowed(node, compute)]
        for names in _by_environment(mine, envs):
            works = {node.id: _work(node, resource) for node in mine if node.id in names}
            found.append(
                CloudProcess(
                    site=resource.id,
                    place=Placement()
                    if resource.kind == "http"
                    else Placement("cloud", resource.node),
                    slots=resource.executors,
                    works=works,
                    codec=_codec(resource),
                    runtime_env=envs[next(iter(works))],
                )
            )
    return tuple(found)


def priced(profile: Profile, resources: Sequence[ComputeConfig]) -> Profile:
    """Profile with the highest cost of `resources`; without any, the benefit, so no gain.

    Args:
        profile: Profile of the analysis.
        resources: Cloud resources that may run it.
    """
    costs = [
        profile.cloud_cost
        if resource.endpoint is None or resource.endpoint.cost is None
        else resource.endpoint.cost
        for resource in resources
    ]
    return replace(profile, cloud_cost=max(costs, default=max(profile.benefit, 0.0)))


def _codec(resource: ComputeConfig) -> Codec:
    # An endpoint's client is on the edge; the endpoint's protocol has its own encoding.
    if resource.kind == "http":
        return Codec("none")
    return Codec(resource.compression)


def _work(node: Node, resource: ComputeConfig) -> Analytics[Any]:
    work: Analytics[Any] = node.work
    if resource.kind != "http":
        return work
    from aerodaas.analytics.endpoint.analysis import (  # noqa: PLC0415 - loads HTTP
        endpoint_analysis,
    )

    return endpoint_analysis(work, short_name(node), resource, strict=True)


def _by_environment(
    nodes: Sequence[Node], envs: Mapping[str, RuntimeEnvConfig | None]
) -> list[set[str]]:
    """Ids of analyses by process: those without an environment of their own share one."""
    plain = {node.id for node in nodes if envs[node.id] is None}
    own = [{node.id} for node in nodes if envs[node.id] is not None]
    return [plain, *own] if plain else own
