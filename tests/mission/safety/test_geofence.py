"""Where a drone may be: polygons, no-fly zones, heights and margins, in metres."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.config.model import GeofenceConfig
from aerodaas.mission.safety.geofence import Geofence

SQUARE = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)]
HOLE = [(40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0)]


def fence(*, polygon: bool = True, hole: bool = False, margin: float = 2.0) -> Geofence:
    """A square of 100 m, a hole of 20 m in it, from 1 to 50 m."""
    return Geofence(
        GeofenceConfig(
            polygon=SQUARE if polygon else [],
            no_fly=[HOLE] if hole else [],
            floor=1.0,
            ceiling=50.0,
            margin=margin,
        )
    )


@pytest.mark.parametrize(
    ("place", "objection"),
    [
        ((50.0, 50.0, 10.0), ""),
        ((2.0, 50.0, 1.0), ""),
        ((98.0, 98.0, 50.0), ""),
        ((1.9, 50.0, 10.0), "within 2 m of the geofence's edge"),
        ((-3.0, 50.0, 10.0), "(-3.0, 50.0) lies 3.0 m outside the geofence"),
        ((50.0, 50.0, 0.99), "0.99 m is under the floor of 1 m"),
        ((50.0, 50.0, 50.01), "50.01 m is above the ceiling of 50 m"),
    ],
)
def test_a_place_keeps_its_margin_and_its_height(
    place: tuple[float, float, float], objection: str
) -> None:
    """On the margin, the floor and the ceiling it is allowed; beyond, it is said by how much."""
    told = fence().objection(np.array(place))
    assert objection in told
    assert bool(told) == bool(objection) == ("limits.geofence" in told)
    assert fence().contains(np.array(place)) == (not objection)


def test_a_no_fly_zone_is_a_hole_in_the_fence_or_in_the_world() -> None:
    """With a fence around it or without: within it, and within its margin, nothing may be."""
    for around in (True, False):
        holed = fence(polygon=around, hole=True)
        assert "10.0 m outside" in holed.objection(np.array([50.0, 50.0, 10.0]))
        assert "within 2 m" in holed.objection(np.array([38.5, 50.0, 10.0]))
        assert holed.contains(np.array([38.0, 50.0, 10.0]))
        assert not holed.inside(np.array([50.0, 50.0, 10.0]))
        assert holed.inside(np.array([39.0, 50.0, 10.0]))
    far = fence(polygon=False, hole=True)
    for east, north in ((9e5, 0.0), (-9e5, 0.0), (0.0, 9e5), (0.0, -9e5)):
        assert far.contains(np.array([east, north, 10.0]))
    assert not fence(hole=True).contains(np.array([900.0, 0.0, 10.0]))


def test_without_polygons_only_heights_bound() -> None:
    """However far off."""
    open_sky = fence(polygon=False)
    assert open_sky.contains(np.array([1e7, -1e7, 10.0]))
    assert open_sky.inside(np.array([1e7, 0.0, 1000.0]))
    assert not open_sky.contains(np.array([0.0, 0.0, 51.0]))
    _, distances = open_sky.edges_near(np.array([0.0, 0.0, 10.0]), 1e9)
    assert len(distances) == 0


@pytest.mark.parametrize(
    ("place", "nearest"),
    [
        ((50.0, 20.0, 10.0), (50.0, 20.0, 10.0)),
        ((-5.0, 20.0, 10.0), (2.0, 20.0, 10.0)),
        ((101.0, 120.0, 60.0), (98.0, 98.0, 50.0)),
        ((45.0, 50.0, 0.0), (38.0, 50.0, 1.0)),
    ],
)
def test_the_nearest_allowed_place(
    place: tuple[float, float, float], nearest: tuple[float, float, float]
) -> None:
    """On the margin of the nearest edge, at the nearest height."""
    assert fence(hole=True).nearest_allowed(np.array(place)) == pytest.approx(nearest)


def test_edges_are_told_with_the_way_to_them() -> None:
    """At (3, 50) the west edge is 3 m off; within 38 m, so is the hole's, 37 m to the east."""
    ways, distances = fence(hole=True).edges_near(np.array([3.0, 50.0, 10.0]), 38.0)
    found = sorted(zip(distances, map(tuple, ways), strict=True))
    assert [round(float(distance), 6) for distance, _ in found] == [3.0, 37.0]
    assert found[0][1] == pytest.approx((-1.0, 0.0))
    assert found[1][1] == pytest.approx((1.0, 0.0))
    _, near = fence(hole=True).edges_near(np.array([3.0, 50.0, 10.0]), 3.0)
    assert len(near) == 0, "not what is as far off as the reach"
