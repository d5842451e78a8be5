"""The order given."""

from __future__ import annotations

from collections.abc import Sequence

from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler

__all__ = ["OrderedScheduler"]


class OrderedScheduler(TrajectoryScheduler):
    """Visits waypoints in the order in which they were added."""

    isolated = False

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:  # noqa: ARG002
        """Keep the order."""
        return pending
