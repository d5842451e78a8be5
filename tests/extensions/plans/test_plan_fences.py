"""Fences of plans as those of environment files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from plan_files import plan

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.fences import geofence_of
from aerodaas.extensions.plans.navigation import read_plan
from aerodaas.extensions.plans.plan import FenceCircle, FencePolygon
from aerodaas.geometry.frames import GeodeticOrigin

HOME = GeodeticOrigin(47.0, 8.0, 535.0)
SQUARE = [[46.999, 7.999], [46.999, 8.001], [47.001, 8.001], [47.001, 7.999]]


def fenced(path: Path, polygons: Any = (), circles: Any = ()) -> Path:  # noqa: ANN401
    """A plan with this fence."""
    fence = {"version": 2, "polygons": list(polygons), "circles": list(circles)}
    return plan(path, geoFence=fence)


def circle(radius: Any, *, inclusion: Any = True) -> dict[str, Any]:  # noqa: ANN401
    """A circle around home."""
    return {"version": 1, "inclusion": inclusion, "circle": {"center": [47, 8], "radius": radius}}


def polygon(corners: Any, *, inclusion: Any = True) -> dict[str, Any]:  # noqa: ANN401
    """A polygon."""
    return {"version": 1, "inclusion": inclusion, "polygon": corners}


def test_a_fence_becomes_one_of_ours(tmp_path: Path) -> None:
    """The area to stay in, and those to stay out of, in metres of home."""
    path = fenced(
        tmp_path / "a.plan",
        [polygon(SQUARE), polygon(SQUARE[:3], inclusion=False)],
        [circle(10, inclusion=False)],
    )
    fence = geofence_of(read_plan(path).fence, HOME)
    assert fence.polygon[0] == pytest.approx((-76.06, -111.18), abs=0.05)
    assert len(fence.polygon) == 4
    assert [len(zone) for zone in fence.no_fly] == [3, 64]
    assert fence.no_fly[0] == fence.polygon[:3]


@given(st.floats(1.0, 5000.0))
def test_circles_are_kept_on_the_safe_side(radius: float) -> None:
    """No corner of what one stays in lies outside the circle, none of its rim in what is left."""
    inner = geofence_of([FenceCircle(inclusion=True, centre=(47.001, 8.0), radius=radius)], HOME)
    outer = geofence_of([FenceCircle(inclusion=False, centre=(47.001, 8.0), radius=radius)], HOME)
    east, north, _ = HOME.to_local(47.001, 8.0, HOME.altitude)
    centre = shapely.Point(east, north)
    within, out = shapely.Polygon(inner.polygon), shapely.Polygon(outer.no_fly[0])
    assert shapely.hausdorff_distance(within, centre) <= radius * (1 + 1e-9)
    assert shapely.distance(out.exterior, centre) >= radius * (1 - 1e-9)
    assert within.area == pytest.approx(out.area, rel=0.01)


def test_one_area_to_stay_in() -> None:
    """Of two it would not be known whether both or either are meant."""
    square = FencePolygon(inclusion=True, corners=tuple((a, b) for a, b in SQUARE))
    with pytest.raises(ConfigError, match="has 2 areas to stay within"):
        geofence_of([square, square], HOME)


@pytest.mark.parametrize(
    ("polygons", "circles", "why"),
    [
        ([polygon(SQUARE[:2])], [], "geofence polygon 1 has 2 corners"),
        ([polygon([[47, 8, 9]] * 3)], [], "must be made of latitude and longitude"),
        ([polygon([[47, True]] * 3)], [], "longitude must be a finite number, not True"),
        ([polygon([[8, 470]] * 3)], [], "is no latitude and longitude"),
        ([polygon(SQUARE, inclusion=1)], [], "inclusion must be true or false"),
        ([], [circle(0)], "circle 1: radius must be positive, not 0"),
        ([], [circle("9")], "radius must be a finite number"),
        ([], [circle(9, inclusion=None)], "inclusion must be true or false"),
        ([], [{"inclusion": True}], "geofence circle 1 must be an object"),
    ],
)
def test_fences_that_are_none(tmp_path: Path, polygons: Any, circles: Any, why: str) -> None:  # noqa: ANN401
    """A fence is read whole or not at all."""
    with pytest.raises(ConfigError, match=why):
        read_plan(fenced(tmp_path / "a.plan", polygons, circles))
