"""Area coverage: everything is seen, no-fly zones are flown around."""

from __future__ import annotations

import math

import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.trajectory.coverage import Coverage, cover, footprint

FIELD = [(0.0, 0.0), (60.0, 0.0), (60.0, 25.0), (0.0, 25.0)]
L_SHAPE = [(0.0, 0.0), (60.0, 0.0), (60.0, 20.0), (25.0, 20.0), (25.0, 60.0), (0.0, 60.0)]
TRIANGLE = [(0.0, 0.0), (50.0, 10.0), (20.0, 45.0)]
ZONE = [(20.0, 8.0), (35.0, 6.0), (33.0, 18.0), (22.0, 16.0)]


def way(plan: Coverage) -> shapely.LineString:
    """The way over the ground."""
    return shapely.LineString([(w.x, w.y) for w in plan.waypoints])


def seen(plan: Coverage, area: BaseGeometry, width: float) -> float:
    """Share of the area that the camera has seen."""
    strip = way(plan).buffer(width / 2, cap_style="flat")
    return float(area.intersection(strip).area / area.area)


def test_the_sweeps_follow_the_long_side() -> None:
    """A rectangle is swept along its longer edges, as often as the footprint asks for."""
    plan = cover(FIELD, height=5.0, width=6.0, overlap=0.2, start=(0.0, 0.0))
    assert plan.angle == 0.0
    assert plan.sweeps == 5
    assert plan.length == pytest.approx(5 * 60 + 19)
    assert all(w.z == 5.0 for w in plan.waypoints)


@given(
    shape=st.sampled_from([FIELD, L_SHAPE, TRIANGLE]),
    angle=st.floats(0, math.pi),
    width=st.floats(3, 15),
    overlap=st.floats(0, 0.6),
)
@settings(max_examples=40)
@example(shape=TRIANGLE, angle=3.1, width=6.7, overlap=0.1)
@example(shape=FIELD, angle=0.76, width=12.6, overlap=0.25)
def test_everything_is_seen(
    shape: list[tuple[float, float]], angle: float, width: float, overlap: float
) -> None:
    """Whatever the direction: no strip is missed, and no corner at a slanting end."""
    plan = cover(shape, height=5.0, width=width, overlap=overlap, angle=angle)
    assert seen(plan, shapely.Polygon(shape), width) > 0.99
    missed = shapely.Polygon(shape).difference(way(plan).buffer(width / 2, cap_style="flat"))
    assert missed.buffer(-0.051 * width).is_empty, "nor a place as wide as a tenth of a strip"


@given(angle=st.floats(0, math.pi), width=st.floats(4, 12))
@settings(max_examples=20)
def test_corners_beside_no_fly_zones_are_seen(angle: float, width: float) -> None:
    """What lies behind a zone that a strip flies around is seen on a line of its own."""
    plan = cover(FIELD, height=5.0, width=width, no_fly=[ZONE], clearance=0.7, angle=angle)
    zone = shapely.Polygon(ZONE)
    assert way(plan).distance(zone) > 0.69
    assert seen(plan, shapely.Polygon(FIELD).difference(zone.buffer(0.7)), width) > 0.985


def test_no_fly_zones_are_flown_around() -> None:
    """The way keeps its clearance, and the rest of the field is seen."""
    plan = cover(FIELD, height=5.0, width=6.0, no_fly=[ZONE], clearance=0.7, start=(0.0, 0.0))
    zone = shapely.Polygon(ZONE)
    assert way(plan).distance(zone) > 0.69
    assert seen(plan, shapely.Polygon(FIELD).difference(zone.buffer(0.7)), 6.0) > 0.98


def test_holes_need_not_be_seen() -> None:
    """A hole as wide as a strip is long makes the way shorter."""
    hole = [(-1.0, 9.0), (61.0, 9.0), (61.0, 26.0), (-1.0, 26.0)]
    assert cover(FIELD, height=5.0, width=5.0, holes=[hole]).length < 0.5 * 380


def test_areas_that_cannot_be_covered_are_refused() -> None:
    """No area, all forbidden, cut in two, or settings that make no sense."""
    wall = [(29.0, -1.0), (31.0, -1.0), (31.0, 26.0), (29.0, 26.0)]
    everything = [(-9.0, -9.0), (99.0, -9.0), (99.0, 99.0), (-9.0, 99.0)]
    for message, outline, zones, width in (
        ("encloses no area", [(0.0, 0.0), (1.0, 1.0)], [], 5.0),
        ("nothing of the area", FIELD, [everything], 5.0),
        ("cut the area", FIELD, [wall], 5.0),
        ("positive width", FIELD, [], 0.0),
    ):
        with pytest.raises(SchedulerError, match=message):
            cover(outline, height=5.0, width=width, no_fly=zones)


def test_footprint() -> None:
    """A right angle of view sees twice the height."""
    assert footprint(10.0, math.pi / 2, 4 / 3) == pytest.approx((20.0, 15.0))
