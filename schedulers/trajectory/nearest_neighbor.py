"""Always the nearest waypoint next."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler

__all__ = ["NearestNeighborScheduler"]


class NearestNeighborScheduler(TrajectoryScheduler):
    """Visits the waypoint nearest to where the drone is, then the one nearest to that, and so on.

    It plans again, from where the drone is by then, as waypoints come and as they are reached.
    Members of an ordered group are only considered once those before them have been visited.
    """

    replans_on_arrival = True
    isolated = False

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Chain nearest neighbours."""
        before = {
            later: earlier for group in situation.ordered for earlier, later in pairwise(group)
        }
        left = {waypoint.id: waypoint for waypoint in pending}
        route: list[Waypoint] = []
        here = situation.position
        while left:
            ready = [waypoint for key, waypoint in left.items() if before.get(key) not in left]
            offsets = np.array([waypoint.position for waypoint in ready]) - here
            nearest = ready[int(np.argmin(np.einsum("ij,ij->i", offsets, offsets)))]
            route.append(left.pop(nearest.id))
            here = nearest.position
        return route
