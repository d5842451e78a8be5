"""Waypoints shared out over several drones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from aerodaas.errors import SchedulerError
from aerodaas.geometry.energy import EnergyModel
from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext
from aerodaas.schedulers.trajectory.greedy import greedy_route
from aerodaas.schedulers.trajectory.routing import (
    DroneRoute,
    RoutingProblem,
    require_solver,
    solve_routes,
)
from aerodaas.schedulers.trajectory.travel import Matrix, TravelCosts

__all__ = ["share_out"]

_HALVINGS = 5
"""Steps of the search for the earliest end, each of which halves the uncertain interval."""


def share_out(
    waypoints: Sequence[Waypoint],
    fleet: Mapping[str, PlanningContext],
    *,
    objective: Literal["energy", "time"] = "energy",
    budget: float = 2.0,
    seed: int = 0,
) -> dict[str, list[Waypoint]]:
    """Give each drone its waypoints, in order; every drone then comes home.

    Each drone's charge less its reserve bounds its own tour.

    Args:
        waypoints: The waypoints, in local ENU; those that no drone can serve, or not by their
            deadline, are left out.
        fleet: Where each drone is, its charge and its speed, by id.
        objective: Least energy of all drones together, or earliest time at which the last one is
            home.
        budget: Time that the search takes, about, seconds.
        seed: Seed of the search.

    Raises:
        SchedulerError: If the fleet has no drones, or PyVRP is not there (on Python 3.10).
    """
    require_solver("sharing waypoints out")
    if not fleet:
        raise SchedulerError("a fleet needs at least one drone")
    if not waypoints:
        return {name: [] for name in fleet}
    drones = list(fleet.values())
    problem = _problem(waypoints, drones)
    simple = _one_after_the_other(waypoints, drones, problem)
    complete = sum(map(len, simple)) == len(waypoints)
    routes = solve_routes(problem, budget / 4, seed, simple if complete else ())
    if routes is None:
        problem = replace(problem, prizes=np.ones(len(waypoints)))
        found = solve_routes(problem, budget / 2, seed, simple) or []
        routes = max(found, simple, key=lambda shared: sum(map(len, shared)))
    elif objective == "time":
        routes = _earliest_end(problem, routes, budget * 3 / 4, seed)
    else:
        routes = solve_routes(problem, budget * 3 / 4, seed) or routes
    return {name: [waypoints[i] for i in route] for name, route in zip(fleet, routes, strict=True)}


def _problem(waypoints: Sequence[Waypoint], drones: list[PlanningContext]) -> RoutingProblem:
    count, size = len(waypoints), len(waypoints) + 2 * len(drones)
    tours: list[DroneRoute] = []
    for number, drone in enumerate(drones):
        travel = TravelCosts.of(waypoints, drone)
        start, home = count + 2 * number, count + 2 * number + 1
        rows = np.ix_([*range(count), start, home], [*range(count), start, home])
        costs: Matrix = np.zeros((size, size))
        durations: Matrix = np.zeros((size, size))
        costs[rows] = travel.charge(drone.energy or EnergyModel())
        durations[rows] = travel.duration
        available = max(0.0, drone.battery - drone.reserve) if drone.energy else np.inf
        tours.append(DroneRoute(start, home, costs, durations, available))
    travel = TravelCosts.of(waypoints, drones[0])
    return RoutingProblem(travel.hover, travel.deadline, tuple(tours))


def _one_after_the_other(
    waypoints: Sequence[Waypoint], drones: list[PlanningContext], problem: RoutingProblem
) -> list[list[int]]:
    """Routes by simple rules, drone after drone, each of what those before it left."""
    left = list(range(len(waypoints)))
    routes: list[list[int]] = []
    for drone, tour in zip(drones, problem.tours, strict=True):
        rows = [*left, tour.start, tour.end]
        costs = tour.costs[np.ix_(rows, rows)]
        some = [waypoints[i] for i in left]
        route = greedy_route(some, drone, costs, np.ones(len(some)), tour.budget) if some else []
        routes.append([left[i] for i in route])
        left = [i for i in left if i not in routes[-1]]
    return routes


def _earliest_end(
    problem: RoutingProblem, routes: list[list[int]], budget: float, seed: int
) -> list[list[int]]:
    """Bisect the time by which all must be home, keeping the best feasible sharing."""
    latest, earliest = _end(problem, routes), 0.0
    for _ in range(_HALVINGS):
        middle = (latest + earliest) / 2
        shorter = solve_routes(replace(problem, latest_end=middle), budget / _HALVINGS, seed)
        if shorter is None:
            earliest = middle
        else:
            routes, latest = shorter, _end(problem, shorter)
    return routes


def _end(problem: RoutingProblem, routes: list[list[int]]) -> float:
    """Seconds until the last drone is home."""
    ends: list[float] = []
    for tour, route in zip(problem.tours, routes, strict=True):
        way = np.array([tour.start, *route, tour.end])
        flown = float(tour.durations[way[:-1], way[1:]].sum()) if route else 0.0
        ends.append(flown + float(problem.hover[route].sum()))
    return max(ends)
