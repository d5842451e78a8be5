"""The shortest way between two places that leaves an area nowhere."""

from __future__ import annotations

import heapq
import math

import shapely
from shapely.geometry.base import BaseGeometry

__all__ = ["Place", "free_path"]

Place = tuple[float, float]
"""East and north in metres."""


def free_path(area: BaseGeometry, start: Place, end: Place) -> list[Place] | None:
    """Corners of the shortest way from `start` to `end` inside `area`, both ends included.

    The straight line where it is free, otherwise a search (A*) over the visibility graph of the
    area's corners (Lozano-Pérez and Wesley, CACM 22(10), 1979). None where there is no way: an end
    lies outside, or in another part of the area.
    """
    roomy = area.buffer(1e-6)  # ends on the edge count as inside
    shapely.prepare(roomy)

    def visible(a: Place, b: Place) -> bool:
        return bool(shapely.covers(roomy, shapely.LineString([a, b])))

    if visible(start, end):
        return [start, end]
    corners = [(float(x), float(y)) for x, y in shapely.get_coordinates(area)]
    places = [start, *sorted(set(corners) - {start, end}), end]
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
        for there, place in enumerate(places):
            if there not in came_from and visible(places[here], place):
                reached = cost + math.dist(places[here], place)
                heapq.heappush(frontier, (reached + math.dist(place, end), reached, there, here))
    return None
