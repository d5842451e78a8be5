"""The six models of the published evaluation, their times, benefits, costs and QoE goals.

Source: Raj, Mittal, Gupta, Simmhan, "Adaptive heuristics for scheduling DNN inferencing on edge
and cloud for personalized UAV fleets", FGCS 2025 (arXiv 2412.20860). Times in milliseconds,
measured on a Jetson edge and on AWS Lambda.
"""

from __future__ import annotations

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import SchedulersConfig, TaskConfig
from aerodaas.identifiers import told
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, QoeGoal

__all__ = ["ACTIVE", "CLOUD_TIME", "EDGE_TIME", "PASSIVE", "PUBLISHED", "told_profile"]

EDGE_TIME, CLOUD_TIME = 100.0, 300.0
"""Milliseconds taken for an execution of which nothing is known yet."""

# model: benefit, deadline, edge time, cloud time, edge cost, cloud cost, QoE bonus, urgent
_TABLE: dict[str, tuple[float, int, int, int, float, float, float, bool]] = {
    "HV": (125, 650, 174, 398, 1, 25, 100, True),
    "DEV": (100, 750, 172, 429, 1, 26, 120, False),
    "MD": (75, 850, 142, 589, 1, 15, 130, False),
    "BP": (40, 900, 244, 542, 2, 43, 150, False),
    "CD": (175, 1000, 563, 878, 4, 152, 140, True),
    "DEO": (250, 950, 739, 832, 6, 210, 160, True),
}

PUBLISHED: dict[str, Profile] = {
    model: Profile(
        model,
        benefit,
        deadline * MILLISECOND,
        edge * MILLISECOND,
        cloud * MILLISECOND,
        edge_cost,
        cloud_cost,
        QoeGoal(bonus),
        urgent,
    )
    for model, (benefit, deadline, edge, cloud, edge_cost, cloud_cost, bonus, urgent) in (
        _TABLE.items()
    )
}
"""Hazard vest, distance to the followed person, mask, body pose, crowd density, obstacles."""

PASSIVE: tuple[str, ...] = ("HV", "DEV", "MD", "BP")
"""Models of the P workloads."""
ACTIVE: tuple[str, ...] = tuple(PUBLISHED)
"""Models of the A workloads."""


def told_profile(model: str, schedulers: SchedulersConfig) -> Profile:
    """Profile of an analysis from the environment file's `schedulers`.

    Args:
        model: The analysis' stream; the file may leave the robot's name out.
        schedulers: The file's figures of tasks and tenants, times in milliseconds.

    Raises:
        SchedulerError: If no scheduler could work with the figures.
    """
    task = told(model, schedulers.tasks) or TaskConfig()
    owners = {name: one for one in schedulers.tenants for name in schedulers.tenants[one].analyses}
    tenant = told(model, owners) or ""
    window = round(task.qoe_window * NANOSECONDS)
    return Profile(
        model,
        task.benefit,
        int(task.deadline * MILLISECOND),
        int((task.edge_time or EDGE_TIME) * MILLISECOND),
        int((task.cloud_time or CLOUD_TIME) * MILLISECOND),
        task.edge_cost,
        task.cloud_cost,
        QoeGoal(task.qoe_bonus, task.qoe_share, window) if task.qoe_bonus else None,
        tenant=tenant,
        weight=schedulers.tenants[tenant].weight if tenant else 1.0,
    )
