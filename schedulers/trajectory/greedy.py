"""Routes of simple rules: a start for the solver, and what no plan may be worse than."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext
from aerodaas.schedulers.trajectory.deadline import DeadlineScheduler
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler
from aerodaas.schedulers.trajectory.travel import Matrix, TravelCosts

__all__ = ["greedy_route", "route_value"]


def greedy_route(
    waypoints: Sequence[Waypoint],
    situation: PlanningContext,
    costs: Matrix,
    prizes: NDArray[np.float64],
    available: float = np.inf,
) -> list[int]:
    """The best route among those of three simple rules.

    The rules are the given order, the nearest waypoint next, and the earliest deadline first. Each
    skips what it would reach too late, or what would not leave enough for the way home.

    Args:
        waypoints: N waypoints in the local frame.
        situation: Where the drone is, and when.
        costs: Cost of each leg, (N + 2, N + 2), as in `TravelCosts`.
        prizes: Worth of each waypoint, (N,), not negative.
        available: Most that the legs may cost, in the unit of `costs`.

    Returns:
        Indices of the waypoints that are served, in their order.
    """
    travel = TravelCosts.of(waypoints, situation)
    index = {waypoint.id: i for i, waypoint in enumerate(waypoints)}
    rules = (NearestNeighborScheduler(), DeadlineScheduler())
    orders = [[index[w.id] for w in rule.plan(waypoints, situation)] for rule in rules]
    routes = [
        _served(order, travel, costs, available) for order in (range(len(waypoints)), *orders)
    ]
    return max(routes, key=lambda route: route_value(route, travel, costs, prizes))


def route_value(
    route: Sequence[int], travel: TravelCosts, costs: Matrix, prizes: NDArray[np.float64]
) -> tuple[float, float]:
    """Value of a route: its prizes first, then how little it costs.

    Args:
        route: Numbers of the waypoints in order.
        travel: Where the route begins and ends.
        costs: Costs from row to column, (N + 2, N + 2).
        prizes: Worth of each waypoint, (N,).

    Returns:
        Sum of the prizes, and the negative cost.
    """
    return float(prizes[list(route)].sum()), -travel.cost(route, costs)


def _served(
    order: Sequence[int], travel: TravelCosts, costs: Matrix, available: float
) -> list[int]:
    home = len(travel.hover) + 1
    here, now, spent = len(travel.hover), 0.0, 0.0
    route: list[int] = []
    for stop in order:
        arrival, cost = now + travel.duration[here, stop], spent + costs[here, stop]
        if arrival <= travel.deadline[stop] and cost + costs[stop, home] <= available:
            route.append(stop)
            here, now, spent = stop, arrival + travel.hover[stop], cost
    return route
