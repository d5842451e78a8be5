"""Ray's options for the environments of a run's processes that run analyses."""

from __future__ import annotations

from typing import Any

from aerodaas.actors.cluster.ray_cluster import nodes_at
from aerodaas.actors.isolation import isolation_options
from aerodaas.runtime.dispatch.offload import CloudProcess
from aerodaas.runtime.plan import ActorPlan, FlightPlan

__all__ = ["environment_options"]


def environment_options(plan: FlightPlan) -> dict[str, dict[str, Any]]:
    """Ray options for the environment of each process that runs analyses, by name.

    Called before any actor exists, so that a failure leaves nothing behind. Raises ConfigError
    for an environment that a node cannot provide, and for a place without a node.
    """
    processes: dict[str, ActorPlan | CloudProcess] = {one.name: one for one in plan.actors}
    for number, process in enumerate(plan.dispatch.cloud if plan.dispatch else ()):
        processes[f"cloud/{number}/{process.site}"] = process
    for place in {*plan.edges, *(one.place for one in processes.values())}:
        nodes_at(place)
    return {
        name: isolation_options(one.runtime_env, one.place, name) for name, one in processes.items()
    }
