"""Where in the cloud each managed analysis may run, and at what price."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.actors.cluster.ray_cluster import Placement
from aerodaas.analytics.base import Analytics
from aerodaas.analytics.endpoint.analysis import endpoint_analysis
from aerodaas.config.model import ComputeConfig, RuntimeEnvConfig
from aerodaas.dataflow.graph import Node
from aerodaas.schedulers.analytics.base import Profile

__all__ = ["CloudProcess", "allowed", "cloud_processes", "priced", "short_name"]


@dataclass(frozen=True)
class CloudProcess:
    """One executor in the cloud: a process on a node, or before an endpoint."""

    site: str
    """Id of the compute resource."""
    place: Placement
    slots: int
    works: dict[str, Analytics[Any]]
    """The analyses that it can run, by stream."""
    compression: str
    runtime_env: RuntimeEnvConfig | None


def short_name(node: Node) -> str:
    """An analysis' name without its robot's."""
    return node.id.rpartition("/")[2]


def allowed(node: Node, compute: Mapping[str, ComputeConfig]) -> list[ComputeConfig]:
    """The resources in the cloud that a scheduler may send a managed analysis to.

    The one that it is deployed on; or else, deployed on an edge, every cloud node, and every
    endpoint that has a model for it.
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
    """The executors for the managed analyses `nodes`, whose environments are `envs`, by id.

    Raises GraphError where an endpoint cannot do what an analysis does.
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
                    compression="none" if resource.kind == "http" else resource.compression,
                    runtime_env=envs[next(iter(works))],
                )
            )
    return tuple(found)


def priced(profile: Profile, resources: Sequence[ComputeConfig]) -> Profile:
    """The profile at the cloud's price: the highest of `resources`; without any, too high."""
    costs = [
        profile.cloud_cost
        if resource.endpoint is None or resource.endpoint.cost is None
        else resource.endpoint.cost
        for resource in resources
    ]
    return replace(profile, cloud_cost=max(costs, default=max(profile.benefit, 0.0)))


def _work(node: Node, resource: ComputeConfig) -> Analytics[Any]:
    work: Analytics[Any] = node.work
    if resource.kind != "http":
        return work
    return endpoint_analysis(work, short_name(node), resource, strict=True)


def _by_environment(
    nodes: Sequence[Node], envs: Mapping[str, RuntimeEnvConfig | None]
) -> list[set[str]]:
    """Analyses that can share a process: those without an environment of their own."""
    plain = {node.id for node in nodes if envs[node.id] is None}
    own = [{node.id} for node in nodes if envs[node.id] is not None]
    return [plain, *own] if plain else own
