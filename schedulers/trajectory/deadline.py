"""Deadlines first: as many waypoints in time as possible, then as short a way as possible."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler
from aerodaas.schedulers.trajectory.travel import TravelCosts

__all__ = ["DeadlineScheduler"]


class DeadlineScheduler(TrajectoryScheduler):
    """Earliest deadline first, with everything else inserted where it costs least.

    Where the deadlines cannot all be met, the waypoint that takes the most time is put off until
    the rest are in time (the rule of Moore and Hodgson, Management Science 15(1), 1968, with
    flight and hover as the time of a job). What is put off is visited last, late.
    """

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Order `pending`; none is left out."""
        travel = TravelCosts.of(pending, situation)
        timed = [i for i in range(len(pending)) if np.isfinite(travel.deadline[i])]
        order: list[int] = []
        late: list[int] = []
        for stop in sorted(timed, key=lambda i: (travel.deadline[i], i)):
            order.append(stop)
            while order and not travel.is_punctual(order):
                late.append(self._costliest(order, travel))
                order.remove(late[-1])
        free = [i for i in range(len(pending)) if not np.isfinite(travel.deadline[i])]
        for stop in [*free, *late]:
            self._insert(stop, order, travel)
        return [pending[i] for i in order]

    @staticmethod
    def _costliest(order: list[int], travel: TravelCosts) -> int:
        """The stop without which the rest of `order` would end soonest."""

        def end_without(stop: int) -> float:
            rest = [other for other in order if other != stop]
            return travel.arrivals(rest)[-1] + travel.hover[rest[-1]] if rest else 0.0

        return min(order, key=end_without)

    @staticmethod
    def _insert(stop: int, order: list[int], travel: TravelCosts) -> None:
        """Insert `stop` where the path grows least without making a punctual stop late."""
        start, home = len(travel.hover), len(travel.hover) + 1
        way = np.array([start, *order, home])
        distance = travel.distance
        growth = distance[way[:-1], stop] + distance[stop, way[1:]] - distance[way[:-1], way[1:]]
        promised = {
            other
            for other, arrival in zip(order, travel.arrivals(order), strict=True)
            if arrival <= travel.deadline[other]
        }
        for place in np.argsort(growth, kind="stable"):
            candidate = [*order[:place], stop, *order[place:]]
            arrivals = dict(zip(candidate, travel.arrivals(candidate), strict=True))
            if all(arrivals[other] <= travel.deadline[other] for other in promised):
                order.insert(int(place), stop)
                return
        order.append(stop)
