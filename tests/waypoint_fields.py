"""Places for trajectory schedulers to order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st

from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext

HOME = PlanningContext(0.0, np.zeros(3), np.zeros(3), speed=2.0)

places = st.lists(
    st.tuples(*[st.integers(-50, 50)] * 2, st.integers(1, 20)), max_size=9, unique=True
)


def waypoints(points: Sequence[tuple[float, float, float]]) -> list[Waypoint]:
    """Waypoints at these places."""
    return [Waypoint(f"w{i}", x, y, z, waypoint_type="local") for i, (x, y, z) in enumerate(points)]


def scatter(count: int, seed: int = 0, side: float = 100.0) -> list[Waypoint]:
    """Random waypoints at 10 m."""
    points = np.random.default_rng(seed).uniform(-side / 2, side / 2, (count, 2))
    return waypoints([(x, y, 10.0) for x, y in points])


def in_a_hurry() -> list[Waypoint]:
    """Three that are all in time only if the nearest one waits."""
    return [
        Waypoint("near", 10, 0, 0, waypoint_type="local", hover_duration=20),
        Waypoint("other", -10, 0, 0, waypoint_type="local", deadline=6.0),
        Waypoint("third", -20, 0, 0, waypoint_type="local", deadline=60.0),
    ]
