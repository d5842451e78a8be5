"""Simulated executions: how long a task takes on the edge and in the cloud, in mission time."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import SimulationConfig
from aerodaas.schedulers.analytics.base import Task

if TYPE_CHECKING:
    from aerodaas.schedulers.lab.network import Network
    from aerodaas.schedulers.lab.times import ExecutionTimes

__all__ = ["Executions"]


@dataclass(frozen=True)
class Executions:
    """Execution times and a network of the laboratory, around the times that a task is told.

    A draw depends on the seed, the analysis and the frame alone: all schedulers meet the same
    ones, in flight as in the laboratory.
    """

    times: ExecutionTimes
    network: Network
    seed: int

    @classmethod
    def of(cls, simulation: SimulationConfig) -> Executions | None:
        """Those of an environment; None where executions take no mission time.

        Raises SchedulerError or UnknownIdError for times and networks that there are not.
        """
        if simulation.execution_times is None:
            return None
        # Few flights simulate executions, and the laboratory takes long to load.
        from aerodaas.schedulers.lab.network import Network  # noqa: PLC0415
        from aerodaas.schedulers.lab.times import ExecutionTimes  # noqa: PLC0415

        period = round(simulation.network_period * NANOSECONDS)
        return cls(
            ExecutionTimes.named(simulation.execution_times),
            Network.named(simulation.network, period),
            simulation.seed,
        )

    def edge_time(self, task: Task) -> int:
        """Nanoseconds on the edge."""
        return self._drawn(task, task.profile.edge_time, "edge")

    def cloud_time(self, task: Task) -> int:
        """Nanoseconds in the cloud, before what the network adds."""
        return self._drawn(task, task.profile.cloud_time, "cloud")

    def _drawn(self, task: Task, nominal: int, place: Literal["edge", "cloud"]) -> int:
        name = f"{self.seed}/{task.profile.model}/{task.source}/{task.segment}/{place}"
        (factor,) = self.times.factors(1, random.Random(name))
        return int(nominal * factor) or 1
