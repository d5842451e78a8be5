"""Costs of travel between waypoints: distances, times and charge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.energy import EnergyModel
from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext

__all__ = ["TravelCosts", "tour_length"]

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class TravelCosts:
    """Costs between N waypoints, the start (row N) and home (row N + 1), from row to column."""

    offset: NDArray[np.float64]
    """Metres east, north and up, (N + 2, N + 2, 3)."""
    distance: Matrix
    """Metres, (N + 2, N + 2)."""
    duration: Matrix
    """Seconds of flight, (N + 2, N + 2)."""
    hover: NDArray[np.float64]
    """Seconds at each waypoint, (N,)."""
    deadline: NDArray[np.float64]
    """Seconds from now, (N,); infinite for none."""
    home_speed: float
    """m/s on the way home."""

    @classmethod
    def of(cls, waypoints: Sequence[Waypoint], situation: PlanningContext) -> TravelCosts:
        """Measure straight legs; each is flown at the speed of the waypoint where it ends.

        Args:
            waypoints: The waypoints, in local ENU.
            situation: Where the drone is, its home and its speed.
        """
        places = np.array([*(w.position for w in waypoints), situation.position, situation.home])
        offsets = places[None, :, :] - places[:, None, :]
        distance = np.sqrt(np.einsum("ijk,ijk->ij", offsets, offsets))
        speeds = np.array(
            [*(w.speed or situation.speed for w in waypoints), situation.speed, situation.speed]
        )
        deadline = [np.inf if w.deadline is None else w.deadline - situation.now for w in waypoints]
        return cls(
            offsets,
            distance,
            distance / speeds[None, :],
            np.array([w.hover_duration for w in waypoints], dtype=np.float64),
            np.array(deadline, dtype=np.float64),
            situation.speed,
        )

    def charge(self, model: EnergyModel) -> Matrix:
        """Charge (0 to 1) of each leg and of the hover where it ends, (N + 2, N + 2).

        The last column is the way home and the landing there.
        """
        seconds = np.where(self.duration > 0.0, self.duration, 1.0)
        hovers = np.append(self.hover, (0.0, 0.0)) * model.hover(1.0)
        flown = model.powers(self.offset / seconds[..., None]) * self.duration / model.endurance
        charge: Matrix = flown + hovers[None, :]
        home = np.zeros(3)
        charge[:, -1] = [model.way_home(-way, home, self.home_speed) for way in self.offset[:, -1]]
        return charge

    def arrivals(self, order: Sequence[int]) -> list[float]:
        """Seconds from now of the arrival at each waypoint of `order`."""
        times: list[float] = []
        here, now = len(self.hover), 0.0
        for there in order:
            now += float(self.duration[here, there])
            times.append(now)
            now += float(self.hover[there])
            here = there
        return times

    def is_punctual(self, order: Sequence[int]) -> bool:
        """Whether `order` reaches every waypoint by its deadline."""
        slack = 1e-9
        return all(
            arrival <= self.deadline[stop] + slack
            for arrival, stop in zip(self.arrivals(order), order, strict=True)
        )

    def cost(self, order: Sequence[int], costs: Matrix) -> float:
        """Sum of `costs` from the start through `order` to home.

        Args:
            order: Numbers of the waypoints in order.
            costs: Costs from row to column, (N + 2, N + 2).
        """
        way = np.array([len(self.hover), *order, len(self.hover) + 1])
        return float(costs[way[:-1], way[1:]].sum())


def tour_length(waypoints: Sequence[Waypoint], situation: PlanningContext) -> float:
    """Metres from where the drone is through `waypoints` in this order and home.

    Args:
        waypoints: The waypoints in order, in local ENU.
        situation: Where the drone is, and its home.
    """
    travel = TravelCosts.of(waypoints, situation)
    return travel.cost(range(len(waypoints)), travel.distance)
