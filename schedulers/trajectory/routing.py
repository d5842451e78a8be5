"""Routing problems for PyVRP: waypoints, drones, costs of legs, and optional waypoints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.config.extras import has_extra
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.trajectory.travel import Matrix

__all__ = ["MOST_PRIZE", "DroneRoute", "RoutingProblem", "require_solver", "solve_routes"]

_RESOLUTION = 1e6
"""Whole units that the largest leg is divided into: PyVRP counts in integers."""
_MILLISECONDS = 1000.0
_UNBOUNDED = int(np.iinfo(np.int64).max)
MOST_PRIZE = 1e6
"""Largest prize: with 1,000 waypoints of it, PyVRP's sums stay within 64 bits."""


@dataclass(frozen=True)
class DroneRoute:
    """One drone: its start and end, the costs of its legs, and its budget."""

    start: int
    """Row of the matrices."""
    end: int
    costs: Matrix
    """The minimised cost, (M, M)."""
    durations: Matrix
    """Seconds, (M, M)."""
    budget: float = np.inf
    """Most that its legs may cost."""


@dataclass(frozen=True)
class RoutingProblem:
    """N waypoints (rows 0 to N - 1 of the matrices) and the drones that share them."""

    hover: NDArray[np.float64]
    """Seconds, (N,)."""
    deadline: NDArray[np.float64]
    """Seconds from now, (N,); infinite for none."""
    tours: tuple[DroneRoute, ...]
    prizes: NDArray[np.float64] | None = None
    """Worth of each waypoint relative to the others, (N,); None where all must be visited."""
    latest_end: float = np.inf
    """Seconds from now by which every drone must be home."""


def require_solver(purpose: str) -> None:
    """Raise SchedulerError, which names `purpose`, where PyVRP is not installed."""
    if not has_extra("routing"):
        raise SchedulerError(
            f"{purpose} needs PyVRP, which exists for Python 3.11 and newer: "
            "pip install 'aerodaas[routing]' there, or take another scheduler"
        )


def solve_routes(
    problem: RoutingProblem,
    budget: float,
    seed: int = 0,
    start: Sequence[Sequence[int]] = (),
) -> list[list[int]] | None:
    """Waypoints of each tour in order, found in about `budget` seconds; None if none is feasible.

    Iterated local search by PyVRP (Wouda, Lan and Kool, INFORMS J. Computing 36(4), 2024). With
    prizes, what is worth most is visited, and the cost decides between equals.

    Args:
        problem: Waypoints and drones; prizes up to `MOST_PRIZE`.
        budget: Seconds for the search.
        seed: Of the search.
        start: A route for each tour from which the search begins; from random ones if empty.
    """
    import pyvrp  # noqa: PLC0415 - not there on Python 3.10
    from pyvrp.stop import MaxRuntime  # noqa: PLC0415

    count = len(problem.hover)
    tours = problem.tours
    unit = _RESOLUTION / (max(float(tour.costs.max()) for tour in tours) or 1.0)
    places = [pyvrp.Location(0.0, 0.0) for _ in tours[0].costs]
    ends = sorted({tour.start for tour in tours} | {tour.end for tour in tours})
    depots = [pyvrp.Depot(place) for place in ends]
    vehicles = [
        pyvrp.VehicleType(
            1,
            start_depot=ends.index(tour.start),
            end_depot=ends.index(tour.end),
            profile=number,
            max_distance=_bound(tour.budget * unit),
            tw_late=_bound(problem.latest_end * _MILLISECONDS),
        )
        for number, tour in enumerate(tours)
    ]
    # A waypoint more is worth more than any saving: than all legs of the longest tour.
    worth = (count + 2) * _RESOLUTION
    clients = [
        pyvrp.Client(
            i,
            service_duration=round(problem.hover[i] * _MILLISECONDS),
            tw_late=_bound(problem.deadline[i] * _MILLISECONDS),
            prize=0 if problem.prizes is None else round(problem.prizes[i] * worth),
            required=problem.prizes is None,
        )
        for i in range(count)
    ]
    data = pyvrp.ProblemData(
        places,
        clients,
        depots,
        vehicles,
        _whole([tour.costs for tour in tours], unit),
        _whole([tour.durations for tour in tours], _MILLISECONDS),
    )
    first = [pyvrp.Route(data, list(route), i) for i, route in enumerate(start) if route]
    result = pyvrp.solve(
        data,
        MaxRuntime(budget),
        seed=seed,
        collect_stats=False,
        display=False,
        initial_solution=pyvrp.Solution(data, first) if first else None,
    )
    if not result.is_feasible():
        return None
    routes: list[list[int]] = [[] for _ in tours]
    for route in result.best.routes():
        routes[route.vehicle_type()] = [step.idx for step in route if step.is_client()]
    return routes


def _whole(matrices: list[Matrix], unit: float) -> list[Any]:
    """Matrices in PyVRP's whole units, rounded up so that a bound that is kept is kept."""
    return [np.ceil(matrix * unit).astype(np.int64) for matrix in matrices]


def _bound(value: float) -> int:
    """A bound in PyVRP's whole units, where the largest number means none."""
    return max(0, int(min(value, _UNBOUNDED)))
