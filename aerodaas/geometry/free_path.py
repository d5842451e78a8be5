"""The shortest way between two places that leaves an area nowhere."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

__all__ = ["FreeArea", "Place", "free_path"]

Place = tuple[float, float]
"""East and north in metres."""


def free_path(area: BaseGeometry, start: Place, end: Place) -> list[Place] | None:
    """Corners of the shortest way inside an area.

    For many ways in one area, a `FreeArea` is faster.

    Args:
        area: Free area, metres.
        start: First end, metres.
        end: Other end, metres.

    Returns:
        The corners, both ends included; None where there is no way: an end lies outside, or in
        another part of the area.
    """
    return FreeArea(area).path(start, end)


class FreeArea:
    """An area prepared for finding many ways in it."""

    def __init__(self, area: BaseGeometry) -> None:
        """Prepare `area`, metres east and north."""
        self._roomy = area.buffer(1e-6)  # ends on the edge count as inside
        shapely.prepare(self._roomy)
        corners = ((float(x), float(y)) for x, y in shapely.get_coordinates(area))
        self._corners = sorted(set(corners))

    def path(self, start: Place, end: Place) -> list[Place] | None:
        """Corners of the shortest way between two places.

        The straight line where it is free, otherwise a search (A*) over the visibility graph of the
        area's corners (Lozano-Pérez and Wesley, CACM 22(10), 1979).

        Args:
            start: First end, metres.
            end: Other end, metres.

        Returns:
            The corners, both ends included; None without any way.
        """
        if self._visible(start, [end])[0]:
            return [start, end]
        places = [start, *(one for one in self._corners if one not in {start, end}), end]
        goal = len(places) - 1
        frontier = [(math.dist(start, end), 0.0, 0, -1)]
        came_from: dict[int, int] = {}
        while frontier:
            _, cost, here, previous = heapq.heappop(frontier)
            if here in came_from:
                continue
            came_from[here] = previous
            if here == goal:
                path = [here]
                while came_from[path[-1]] >= 0:
                    path.append(came_from[path[-1]])
                return [places[index] for index in reversed(path)]
            left = [there for there in range(len(places)) if there not in came_from]
            seen = self._visible(places[here], [places[there] for there in left])
            for there, visible in zip(left, seen, strict=True):
                if visible:
                    reached = cost + math.dist(places[here], places[there])
                    estimate = reached + math.dist(places[there], end)
                    heapq.heappush(frontier, (estimate, reached, there, here))
        return None

    def _visible(self, here: Place, places: Sequence[Place]) -> NDArray[np.bool_]:
        """Which of `places` are seen from `here`."""
        ends = np.asarray(places, dtype=np.float64).reshape(-1, 2)
        lines = np.stack([np.broadcast_to(np.asarray(here), ends.shape), ends], axis=1)
        return np.atleast_1d(shapely.covers(self._roomy, shapely.linestrings(lines)))
