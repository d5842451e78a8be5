"""A sample path: everything that chance decides, drawn before any scheduler sees it."""

from __future__ import annotations

import random
from dataclasses import dataclass

from aerodaas.schedulers.analytics.base import Task
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.workload import Workload

__all__ = ["SamplePath"]


@dataclass(frozen=True, slots=True)
class SamplePath:
    """One edge's tasks and how long each would take; equal for every scheduler compared."""

    tasks: list[Task]
    edge_times: list[int]
    """By task id, nanoseconds."""
    cloud_times: list[int]
    """By task id, nanoseconds, before the network's share."""
    network: Network

    @classmethod
    def draw(
        cls, workload: Workload, edge: int, seed: int, times: ExecutionTimes, network: Network
    ) -> SamplePath:
        """Draw the path of one edge; the same arguments give the same path.

        Args:
            workload: The drones and their tasks.
            edge: Number of the edge, from 0.
            seed: Seed of all that is drawn.
            times: Distribution of execution times.
            network: Of the path to the cloud.
        """
        # One stream for each purpose: another distribution leaves the arrivals as they are.
        tasks = workload.tasks(edge, random.Random(f"{seed}/{edge}/arrivals"))
        edge_factors = times.factors(len(tasks), random.Random(f"{seed}/{edge}/edge"))
        cloud_factors = times.factors(len(tasks), random.Random(f"{seed}/{edge}/cloud"))
        edge_times = [
            int(task.profile.edge_time * factor) or 1
            for task, factor in zip(tasks, edge_factors, strict=True)
        ]
        cloud_times = [
            int(task.profile.cloud_time * factor) or 1
            for task, factor in zip(tasks, cloud_factors, strict=True)
        ]
        for number, arrival in enumerate(workload.arrivals_at(edge)):
            edge_times[number] = arrival.edge_time or edge_times[number]
            cloud_times[number] = arrival.cloud_time or cloud_times[number]
        return cls(tasks, edge_times, cloud_times, network)
