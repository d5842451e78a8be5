"""The most urgent first, then the soonest deadline, then the nearest."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler

__all__ = ["PriorityScheduler"]


class PriorityScheduler(TrajectoryScheduler):
    """Serves waypoints by urgency; preemption between priorities is the queue's own doing."""

    replans_on_arrival = True
    isolated = False

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Sort by priority and deadline; the nearest of equals comes next, seen from each stop."""
        left = list(pending)
        route: list[Waypoint] = []
        here = situation.position
        while left:
            place = here
            best = min(
                left,
                key=lambda waypoint: (
                    waypoint.priority,
                    math.inf if waypoint.deadline is None else waypoint.deadline,
                    float(np.linalg.norm(waypoint.position - place)),
                ),
            )
            left.remove(best)
            route.append(best)
            here = best.position
        return route
