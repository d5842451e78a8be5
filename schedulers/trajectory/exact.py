"""The shortest way by dynamic programming, for few waypoints.

Held and Karp, "A Dynamic Programming Approach to Sequencing Problems", J. SIAM 10(1), 1962: the
best way through each set of waypoints that ends at each of its members. Two conditions fit in
without losing exactness: an order to keep, and deadlines where the cost is the time itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aerodaas.schedulers.trajectory.travel import Matrix

__all__ = ["shortest_order"]


def shortest_order(
    costs: Matrix,
    groups: Sequence[Sequence[int]] = (),
    latest: NDArray[np.float64] | None = None,
) -> list[int] | None:
    """Order of N waypoints with the least sum of `costs`; takes 2^N N² steps.

    Args:
        costs: Costs from row to column, (N + 2, N + 2), see `TravelCosts`.
        groups: Numbers of waypoints; each group is visited in its order.
        latest: Bounds of the cost on arrival at each waypoint, (N,); None for none.

    Returns:
        Numbers of the waypoints in order; None if no order keeps these conditions.
    """
    count = len(costs) - 2
    if count == 0:
        return []
    needs = np.zeros(count, dtype=np.int64)
    for group in groups:
        for earlier, later in pairwise(group):
            needs[later] |= 1 << earlier
    bounds = np.full(count, np.inf) if latest is None else latest + 1e-9
    legs, members = costs[:count, :count], 1 << np.arange(count)
    best = np.full((1 << count, count), np.inf)
    start = costs[count, :count]
    best[members, np.arange(count)] = np.where((needs == 0) & (start <= bounds), start, np.inf)
    came_from = np.full((1 << count, count), -1, dtype=np.int8)
    for visited in range(1, 1 << count):
        row = best[visited]
        if not np.isfinite(row).any():
            continue
        through = row[:, None] + legs
        previous = through.argmin(axis=0)
        reached = through[previous, np.arange(count)]
        allowed = ((visited & members) == 0) & ((visited & needs) == needs) & (reached <= bounds)
        following = visited | members[allowed]
        stops = np.flatnonzero(allowed)
        shorter = reached[stops] < best[following, stops]
        best[following[shorter], stops[shorter]] = reached[stops[shorter]]
        came_from[following[shorter], stops[shorter]] = previous[stops[shorter]]
    everything = (1 << count) - 1
    total = best[everything] + costs[:count, count + 1]
    last = int(total.argmin())
    if not np.isfinite(total[last]):
        return None
    order: list[int] = []
    visited = everything
    while last >= 0:
        order.append(last)
        last, visited = int(came_from[visited, last]), visited & ~(1 << last)
    return order[::-1]
