"""Fences of plans as those of environment files, and structure scans as ways around structures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from keywords import keywords
from plan_files import plan

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.fences import geofence_of
from aerodaas.extensions.plans.plan import FenceCircle, FencePolygon
from aerodaas.extensions.plans.reading import flown_plan, read_plan
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


def scan(**changes: Any) -> dict[str, Any]:  # noqa: ANN401
    """A structure scan of a block, 40 m high, in four layers."""
    camera = {"DistanceToSurface": 25, "AdjustedFootprintFrontal": 10, "AdjustedFootprintSide": 8}
    return {
        "type": "ComplexItem",
        "complexItemType": "StructureScan",
        "version": 3,
        "CameraCalc": camera | changes.pop("camera", {}),
        "EntranceAltitude": 60,
        "ScanBottomAlt": 2,
        "StructureHeight": 40,
        "Layers": 4,
        "StartFromTop": False,
        "polygon": SQUARE,
    } | changes


def test_a_structure_scan_is_flown_around_the_structure(tmp_path: Path) -> None:
    """From an entrance, in rounds at its distance, a layer each, and back to the entrance."""
    waypoints, notices = flown_plan(plan(tmp_path / "a.plan", scan()))
    heights = [one.z for one in waypoints]
    assert heights == [60, *[7.0] * 5, *[17.0] * 5, *[27.0] * 5, *[37.0] * 5, 60]
    assert [one.id for one in waypoints][:4] == ["item1", "item3", "item5", "item6"]
    places = [HOME.to_local(one.x, one.y, HOME.altitude)[:2] for one in waypoints]
    block = shapely.Polygon([HOME.to_local(a, b, HOME.altitude)[:2] for a, b in SQUARE])
    for index in range(4):
        ring = places[1 + 5 * index : 6 + 5 * index]
        assert ring[0] == pytest.approx(ring[-1])
        assert shapely.distance(shapely.LineString(ring), block) == pytest.approx(25, abs=0.1)
        assert ring[0] == pytest.approx((-101.06, -136.18), abs=0.1)
        assert not shapely.LinearRing(ring).is_ccw
    assert places[0] == pytest.approx(places[1])
    assert places[0] == pytest.approx(places[-1])
    assert [(one.command, len(one.numbers)) for one in notices] == [
        ("DO_SET_ROI_WPNEXT_OFFSET", 1),
        ("DO_SET_ROI_NONE", 1),
    ]
    triggered = [keywords(one).trigger_distance is not None for one in waypoints]
    assert triggered == [False, *[False, True, True, True, True] * 4, False]


def test_a_structure_scan_from_the_top(tmp_path: Path) -> None:
    """Its layers hang from the structure's height."""
    waypoints, _ = flown_plan(plan(tmp_path / "a.plan", scan(StartFromTop=True)))
    assert sorted({one.z for one in waypoints}) == [5.0, 15.0, 25.0, 35.0, 60.0]
    assert waypoints[1].z == 35.0


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"version": 2}, "not of version 3: open it in a current QGroundControl"),
        ({"Layers": 0}, "Layers must be positive"),
        ({"Layers": 201}, "Layers must be 1 to 200"),
        ({"Layers": True}, "Layers must be a finite number"),
        ({"camera": {"DistanceToSurface": -1}}, "DistanceToSurface must be positive"),
        ({"camera": {"DistanceToSurface": 2e3}}, "DistanceToSurface must be at most 1000 m"),
        ({"CameraCalc": []}, "CameraCalc must be an object"),
        ({"EntranceAltitude": None}, "EntranceAltitude must be a finite number"),
        ({"polygon": SQUARE[:2]}, "polygon must have 3 to 500 corners"),
        ({"polygon": [*SQUARE[:3], [47]]}, "a corner must be made of"),
        ({"polygon": [SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]]}, "crosses itself"),
    ],
)
def test_structure_scans_that_cannot_be_flown(
    tmp_path: Path, changes: dict[str, Any], why: str
) -> None:
    """Refused by number and reason."""
    with pytest.raises(ConfigError, match=rf"item 1 \(StructureScan\).*{why}"):
        read_plan(plan(tmp_path / "a.plan", scan(**changes)))
