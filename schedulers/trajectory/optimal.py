"""The least way or the least energy, with deadlines, hovers and the battery kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aerodaas.config.checked import Positive
from aerodaas.dataflow.interfaces import IEnvironment
from aerodaas.errors import SchedulerError
from aerodaas.geometry.energy import EnergyModel
from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler
from aerodaas.schedulers.trajectory.exact import shortest_order
from aerodaas.schedulers.trajectory.greedy import greedy_route, route_value
from aerodaas.schedulers.trajectory.routing import (
    MOST_PRIZE,
    DroneRoute,
    RoutingProblem,
    require_solver,
    solve_routes,
)
from aerodaas.schedulers.trajectory.travel import Matrix, TravelCosts

__all__ = ["OptimalScheduler"]

_EXACT = 11
"""Waypoints up to which dynamic programming answers within some 30 ms."""


class OptimalScheduler(TrajectoryScheduler):
    """Plans the best way from where the drone is through all waypoints and home.

    Up to 11 waypoints the plan is exact; beyond, it is the best that PyVRP finds in a time that
    grows with their number. Deadlines are time windows and hovers are service times. Where the
    battery (or a deadline) does not allow every waypoint, as many as possible are visited,
    weighted by their prizes, and the others are given up. A plan is never worth less than that of
    the given order, the nearest waypoint next, or the earliest deadline first.
    """

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        objective: Literal["distance", "energy"] = "distance",
        prizes: Mapping[str, float] | None = None,
        budget: Positive | None = None,
        seed: int = 0,
    ) -> None:
        """Minimise the length or the energy of the tour.

        Args:
            environment: The environment, whose graph records the navigation.
            objective: `distance` or `energy`.
            prizes: Weight of waypoints by id, 0 to 1e6, where not all can be visited; 1 where not
                named.
            budget: Seconds of the search; by default 9.5 ms a waypoint, up to 1.9 s.
            seed: Of the search.

        Raises:
            SchedulerError: For settings that make no sense, and without PyVRP (on Python 3.10).
        """
        super().__init__(environment)
        require_solver("the optimal scheduler")
        if objective not in {"distance", "energy"}:
            raise SchedulerError(f"the objective is distance or energy, not {objective!r}")
        if budget is not None and not 0.0 < budget < np.inf:
            raise SchedulerError(f"a planning budget is a positive number of seconds, not {budget}")
        for waypoint, prize in (prizes or {}).items():
            if not 0.0 <= prize <= MOST_PRIZE:
                raise SchedulerError(
                    f"the prize of {waypoint!r} must be from 0 to {MOST_PRIZE:g}, not {prize}: "
                    "prizes count relative to each other, so divide them all"
                )
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
        limited = situation.energy is not None
        available = situation.battery - situation.reserve if limited else np.inf
        if order is None or travel.cost(order, charge) > available:
            bounded = charge if limited else costs
            order = self._choose(pending, situation, travel, bounded, available)
        back = order[::-1]
        # Of two directions that cost the same, people expect the one that begins as they gave it.
        if (
            back < order
            and not any(map(len, situation.ordered))
            and np.isclose(travel.cost(order, costs), travel.cost(back, costs), rtol=1e-9)
            and travel.cost(back, charge) <= available
            and travel.is_punctual(back)
        ):
            order = back
        return [pending[i] for i in order]

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
        simple = greedy_route(pending, situation, costs, np.ones(count))
        if len(simple) < count:
            return None
        return self._search(travel, costs, None, np.inf, simple) or simple

    def _choose(
        self,
        pending: Sequence[Waypoint],
        situation: PlanningContext,
        travel: TravelCosts,
        costs: Matrix,
        available: float,
    ) -> list[int]:
        """The waypoints worth most that can be served, in the best order."""
        prizes = np.array([self._prizes.get(waypoint.id, 1.0) for waypoint in pending])
        simple = greedy_route(pending, situation, costs, prizes, available)
        found = self._search(travel, costs, prizes, available, simple) or []
        return max(found, simple, key=lambda route: route_value(route, travel, costs, prizes))

    def _search(
        self,
        travel: TravelCosts,
        costs: Matrix,
        prizes: NDArray[np.float64] | None,
        available: float,
        start: Sequence[int],
    ) -> list[int] | None:
        count = len(travel.hover)
        problem = RoutingProblem(
            travel.hover,
            travel.deadline,
            (DroneRoute(count, count + 1, costs, travel.duration, available),),
            prizes,
        )
        budget = self._budget or min(1.9, 0.0095 * count)
        routes = solve_routes(problem, budget, self._seed, [start])
        return None if routes is None else routes[0]
