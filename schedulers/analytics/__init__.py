"""Analytics schedulers: which inference runs where, and when."""

from __future__ import annotations

from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Decision,
    Drop,
    Profile,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    WakeAt,
)
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names

__all__ = [
    "AnalyticsScheduler",
    "Decision",
    "Drop",
    "Profile",
    "Resources",
    "Result",
    "RunOnEdge",
    "SendToCloud",
    "Task",
    "WakeAt",
    "load_scheduler",
    "scheduler_names",
]
