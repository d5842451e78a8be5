"""The order given."""

from __future__ import annotations

from collections.abc import Sequence

from aerodaas.schedulers.waypoint.base import Situation, TrajectoryScheduler
from aerodaas.waypoints import Waypoint

__all__ = ["OrderedScheduler"]


class OrderedScheduler(TrajectoryScheduler):
    """Visits waypoints in the order in which they were added."""

    isolated = False

    def plan(self, pending: Sequence[Waypoint], situation: Situation) -> Sequence[Waypoint]:  # noqa: ARG002
        """Keep the order."""
        return pending
