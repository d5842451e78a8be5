"""The least way or the least energy, with deadlines, hovers and the battery kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aerodaas.dataflow.interfaces import IEnvironment
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler
from aerodaas.schedulers.trajectory.exact import shortest_order
from aerodaas.schedulers.trajectory.routing import (
    DroneRoute,
    RoutingProblem,
    require_solver,
    solve_routes,
)
from aerodaas.schedulers.trajectory.travel import Matrix, TravelCosts
from aerodaas.types.energy import EnergyModel
from aerodaas.types.errors import SchedulerError
from aerodaas.types.waypoints import Waypoint

__all__ = ["OptimalScheduler"]

_EXACT = 11
"""Waypoints up to which dynamic programming answers within some 30 ms."""


class OptimalScheduler(TrajectoryScheduler):
    """Plans the best way from where the drone is through all waypoints and home.

    Up to 11 waypoints the plan is exact; beyond, it is the best that PyVRP finds in a time that
    grows with their number. Deadlines are time windows and hovers are service times. Where the
    battery (or a deadline) does not allow every waypoint, as many as possible are visited,
    weighted by their prizes, and the others are given up.
    """

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        objective: Literal["distance", "energy"] = "distance",
        prizes: Mapping[str, float] | None = None,
        budget: float | None = None,
        seed: int = 0,
    ) -> None:
        """Minimise `objective`, in `budget` seconds (None: 9.5 ms a waypoint, up to 1.9 s).

        `prizes` weighs waypoints by id where not all can be visited; 1 where not named. Raises
        SchedulerError for settings that make no sense, and without PyVRP (on Python 3.10).
        """
        super().__init__(environment)
        require_solver("the optimal scheduler")
        if objective not in {"distance", "energy"}:
            raise SchedulerError(f"the objective is distance or energy, not {objective!r}")
        if budget is not None and not 0.0 < budget < np.inf:
            raise SchedulerError(f"a planning budget is a positive number of seconds, not {budget}")
        if any(not 0.0 <= prize < np.inf for prize in (prizes or {}).values()):
            raise SchedulerError("prizes are finite and not negative")
        self._objective = objective
        self._prizes = dict(prizes or {})
        self._budget = budget
        self._seed = seed

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Order `pending`; unreachable waypoints are left out."""
        if not pending:
            return []
        travel = TravelCosts.of(pending, situation)
        charge = travel.charge(situation.energy or EnergyModel())
        costs = charge if self._objective == "energy" else travel.distance
        order = self._order(pending, situation, travel, costs)
        if order is not None and situation.energy is not None:
            available = situation.battery - situation.reserve
            if travel.cost(order, charge) > available:
                order = self._choose(pending, travel, charge, available)
        elif order is None:
            order = self._choose(pending, travel, costs, np.inf)
        return [pending[i] for i in self._forwards(order, travel, costs, situation)]

    @staticmethod
    def _forwards(
        order: list[int], travel: TravelCosts, costs: Matrix, situation: PlanningContext
    ) -> list[int]:
        """Of two directions that cost the same, the one that begins as the waypoints were given."""
        back = order[::-1]
        if not order or order[0] < back[0] or any(map(len, situation.ordered)):
            return order
        same = bool(np.isclose(travel.cost(order, costs), travel.cost(back, costs), rtol=1e-9))
        return back if same and travel.is_punctual(back) else order

    def _order(
        self,
        pending: Sequence[Waypoint],
        situation: PlanningContext,
        travel: TravelCosts,
        costs: Matrix,
    ) -> list[int] | None:
        """The best order of all waypoints, or None where the deadlines allow no order."""
        count = len(pending)
        index = {waypoint.id: i for i, waypoint in enumerate(pending)}
        groups = [[index[key] for key in group if key in index] for group in situation.ordered]
        if any(len(group) == count for group in groups):
            return list(range(count))
        timed = bool(np.isfinite(travel.deadline).any())
        if count <= _EXACT and not timed:
            return shortest_order(costs, groups)
        alike = len({waypoint.speed or situation.speed for waypoint in pending}) == 1
        if count <= _EXACT and alike and self._objective == "distance":
            # At one speed, the least time is the least distance: hovers add the same to any order.
            times = travel.duration.copy()
            times[:count] += travel.hover[:, None]
            return shortest_order(times, groups, travel.deadline)
        return self._search(travel, costs, None, np.inf)

    def _choose(
        self, pending: Sequence[Waypoint], travel: TravelCosts, costs: Matrix, available: float
    ) -> list[int]:
        """The waypoints worth most that can be served, in the best order."""
        prizes = np.array([self._prizes.get(waypoint.id, 1.0) for waypoint in pending])
        return self._search(travel, costs, prizes, available) or []

    def _search(
        self,
        travel: TravelCosts,
        costs: Matrix,
        prizes: NDArray[np.float64] | None,
        available: float,
    ) -> list[int] | None:
        count = len(travel.hover)
        problem = RoutingProblem(
            travel.hover,
            travel.deadline,
            (DroneRoute(count, count + 1, costs, travel.duration, available),),
            prizes,
        )
        budget = self._budget or min(1.9, 0.0095 * count)
        routes = solve_routes(problem, budget, self._seed)
        return None if routes is None else routes[0]
