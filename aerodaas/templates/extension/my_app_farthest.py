"""A trajectory scheduler of your own: the farthest waypoint first."""

from collections.abc import Sequence

import numpy as np

from aerodaas import TrajectoryScheduler, Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext


class Farthest(TrajectoryScheduler):
    """Visits the farthest waypoint first."""

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Order the waypoints by their distance from the drone, farthest first."""
        here = situation.position
        return sorted(pending, key=lambda stop: -float(np.linalg.norm(stop.position - here)))
