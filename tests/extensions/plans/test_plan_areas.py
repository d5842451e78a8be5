"""Areas from KML and GeoJSON: places and holes; strangers' files within bounds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.areas import Area, read_areas
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.schedulers.trajectory.coverage import cover

HOME = GeodeticOrigin(47.0, 8.0, 535.0)
RING = [[8.0, 47.0], [8.002, 47.0], [8.002, 47.001], [8.0, 47.001], [8.0, 47.0]]
HOLE = [[8.001, 47.0004], [8.0012, 47.0004], [8.0012, 47.0006], [8.001, 47.0004]]
CORNERS = ((47.0, 8.0), (47.0, 8.002), (47.001, 8.002), (47.001, 8.0))


def geojson(path: Path, content: Any) -> Path:  # noqa: ANN401
    """Write it."""
    path.write_text(json.dumps(content))
    return path


def polygon(*rings: Any) -> dict[str, Any]:  # noqa: ANN401
    """A bare geometry."""
    return {"type": "Polygon", "coordinates": list(rings)}


def kml_ring(ring: Any, side: str) -> str:  # noqa: ANN401
    """A boundary."""
    corners = "\n ".join(",".join(map(str, [*at, 12.5])) for at in ring)
    inner = f"<LinearRing><coordinates>\n {corners}\n</coordinates></LinearRing>"
    return f"<{side}BoundaryIs>{inner}</{side}BoundaryIs>"


def kml(path: Path, *placemarks: str) -> Path:
    """Write a document of placemarks in a folder."""
    marks = "".join(f"<Placemark>{one}</Placemark>" for one in placemarks)
    head = '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2">'
    path.write_text(f"{head}<Document><Folder>{marks}</Folder></Document></kml>")
    return path


def test_features_become_areas(tmp_path: Path) -> None:
    """With names and holes; the repeated corner at the end of a ring is one."""
    feature = {"type": "Feature", "properties": {"name": "field"}, "geometry": polygon(RING, HOLE)}
    (area,) = read_areas(
        geojson(tmp_path / "a.geojson", {"type": "FeatureCollection", "features": [feature]})
    )
    assert (area.name, area.outline) == ("field", CORNERS)
    assert area.holes == (((47.0004, 8.001), (47.0004, 8.0012), (47.0006, 8.0012)),)


def test_placemarks_become_areas(tmp_path: Path) -> None:
    """The same from KML, whichever boundary comes first."""
    rings = kml_ring(HOLE, "inner") + kml_ring(RING, "outer")
    (area,) = read_areas(kml(tmp_path / "a.kml", f"<name>field</name><Polygon>{rings}</Polygon>"))
    assert area == Area(
        "field", CORNERS, (((47.0004, 8.001), (47.0004, 8.0012), (47.0006, 8.0012)),)
    )


def test_bare_and_many_polygons(tmp_path: Path) -> None:
    """Geometries, collections, several polygons of one: in the file's order, numbered."""
    assert [one.name for one in read_areas(geojson(tmp_path / "a.json", polygon(RING)))] == [
        "area1"
    ]
    several = {"type": "MultiPolygon", "coordinates": [[RING], [HOLE]]}
    both = {"type": "GeometryCollection", "geometries": [several, polygon(RING)]}
    areas = read_areas(geojson(tmp_path / "b.json", both))
    assert [(one.name, len(one.outline)) for one in areas] == [
        ("area1", 4),
        ("area2", 3),
        ("area3", 4),
    ]
    nested = (
        f"<MultiGeometry>{'<Polygon>' + kml_ring(RING, 'outer') + '</Polygon>'}</MultiGeometry>"
    )
    assert len(read_areas(kml(tmp_path / "c.kml", nested, nested))) == 2


def test_an_area_is_covered(tmp_path: Path) -> None:
    """In metres of home, as the coverage planner takes them."""
    (area,) = read_areas(geojson(tmp_path / "a.json", polygon(RING, HOLE)))
    outline, holes = area.local(HOME)
    assert outline[2] == pytest.approx((152.1, 111.2), abs=0.1)
    sweeps = cover(outline, holes=holes, height=30.0, width=20.0).waypoints
    assert len(sweeps) > 8
    assert all(-1 <= one.x <= 153 and -1 <= one.y <= 112 for one in sweeps)


def test_what_is_no_area_is_said(tmp_path: Path) -> None:
    """By one warning that counts it."""
    point, line = {"type": "Point", "coordinates": [8, 47]}, {"type": "LineString"}
    both = {"type": "GeometryCollection", "geometries": [point, polygon(RING), line, point]}
    with pytest.warns(
        UserWarning, match="only polygons are areas; left out: 2 Point, 1 LineString"
    ):
        read_areas(geojson(tmp_path / "a.json", both))
    marks = f"<Polygon>{kml_ring(RING, 'outer')}</Polygon>", "<Point/>", "<LineString/>"
    with pytest.warns(UserWarning, match="left out: 1 Point, 1 LineString") as warned:
        read_areas(kml(tmp_path / "a.kml", *marks))
    assert warned[0].filename == __file__


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ([], "it is no GeoJSON: an object is missing"),
        ({}, "an object has no type"),
        ({"type": "FeatureCollection", "features": 3}, "features must be a list"),
        ({"type": "FeatureCollection", "features": []}, "holds no polygon; draw"),
        ({"type": "Feature", "geometry": None}, "holds no polygon; draw"),
        (polygon(), "polygon 1 has no outline"),
        (polygon(RING[:2]), "polygon 1 has less than three corners"),
        (polygon([RING[0]] * 5), "polygon 1 has less than three corners"),
        (polygon([[8.0], [8.1], [8.2]]), "a corner is '8.0', not longitude, latitude"),
        # Two corners in one, and numbers with decimal commas: [8,541, 47,376], [8,541, 47,376, 9].
        (polygon([*RING[:3], [8.01, 47.0, 0, 8.01, 47.01, 0]]), "8.01,47.0,0,8.01,47.01,0"),
        (polygon(RING, [*HOLE, [8, 541, 47, 376]]), "a corner is '8,541,47,376'"),
        (polygon([*RING, [8, 541, 47, 376, 9]]), "a corner is '8,541,47,376,9'"),
        (polygon([*RING, [8.0, 47.0, "9"]]), "height must be a finite number, not '9'"),
        (polygon(8.0, 47.0), "a polygon must be a list of rings"),
        (polygon([[True, 47], [8, 47], [8, 46]]), "longitude must be a finite number, not True"),
        (polygon([["8", 47], [8, 47], [8, 46]]), "longitude must be a finite number, not '8'"),
        (polygon([[8, 170], [8, 47], [8, 46]]), "are the two exchanged"),
        (polygon([[180.001, 47], [8, 47], [8, 46]]), r"\(47, 180.001\) .*-180 to 180"),
        (polygon(RING) | {"crs": {"properties": {"name": "EPSG:2056"}}}, "export them as WGS84"),
        (polygon(RING) | {"crs": 7}, "export them as WGS84"),
        (polygon([[8 + i / 1e5, 47] for i in range(20_001)]), "more than 20000 corners"),
        ({"type": "MultiPolygon", "coordinates": [[HOLE]] * 1001}, "more than 1000 polygons"),
    ],
)
def test_geojson_that_is_refused(tmp_path: Path, content: Any, why: str) -> None:  # noqa: ANN401
    """With the remedy."""
    with pytest.raises(ConfigError, match=f"a.geojson .*{why}"):
        read_areas(geojson(tmp_path / "a.geojson", content))


def test_coordinates_that_are_named_as_they_are(tmp_path: Path) -> None:
    """WGS84, as older writers name it."""
    for name in ("urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326", "urn:ogc:def:crs:EPSG::4326"):
        crs = {"type": "name", "properties": {"name": name}}
        assert read_areas(geojson(tmp_path / "a.json", polygon(RING) | {"crs": crs}))


OUTER = kml_ring(RING, "outer")


def written(coordinates: str) -> str:
    """KML whose outline has these coordinates, as they stand."""
    ring = f"<LinearRing><coordinates>{coordinates}</coordinates></LinearRing>"
    polygon = f"<Polygon><outerBoundaryIs>{ring}</outerBoundaryIs></Polygon>"
    return f"<kml><Placemark>{polygon}</Placemark></kml>"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('<!DOCTYPE kml [<!ENTITY a "b">]><kml/>', "declares no entities; this file is not read"),
        ("<kml>", "it is no XML"),
        ("<gpx/>", "XML of the kind 'gpx', not KML"),
        ("<kml/>", "holds no polygon; draw"),
        (f"<kml>{'<a>' * 60_000}", "nested more than 40 levels deep"),
        (f"<kml>{'<a/>' * 200_001}</kml>", "more than 200000 elements"),
        ("<kml><Placemark><Polygon/></Placemark></kml>", "must have one outerBoundaryIs"),
        (
            f"<kml><Placemark><Polygon>{OUTER * 2}</Polygon></Placemark></kml>",
            "must have one outerBoundaryIs",
        ),
        (
            f"<kml><Placemark><Polygon>{OUTER}</Polygon></Placemark></kml>".replace("8.002", "x"),
            "a coordinate must be a number, not 'x'",
        ),
        (
            f"<kml><Placemark><Polygon>{OUTER}</Polygon></Placemark></kml>".replace("8.002", "nan"),
            "longitude must be a finite number, not nan",
        ),
        (
            f"<kml><Placemark><Polygon>{OUTER}</Polygon></Placemark></kml>".replace(",", ";"),
            "a coordinate must be a number, not '8.0;47.0;12.5'",
        ),
        (written("8,000 47,000 8,002 47,000 8,002 47,001"), "a corner is '8,000': write"),
        (written("8,5417 47,3769 8,5418 47,3769 8,5418 47,3770"), "a corner is '8,5417'"),
        (written("8,541,47,376 8,542,47,376 8,542,47,377"), "'8.0,541.0,47.0,376.0', not"),
        (written("8,541,47,376,9 8,542,47,376,9 8,542,47,377,9"), "a corner is '8.0,541.0"),
        (written("8.0,47.0,0,8.0,47.1,0 8.1,47.1,0 8.1,47.0,0"), "'8.0,47.0,0.0,8.0,47.1"),
        (written("8.0,47.0,x 8.0,47.1 8.1,47.1"), "a coordinate must be a number, not 'x'"),
    ],
    ids=lambda one: one[:30],
)
def test_kml_that_is_refused(tmp_path: Path, text: str, why: str) -> None:
    """With the remedy, whatever it would grow to."""
    path = tmp_path / "a.kml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=why):
        read_areas(path)


def test_entities_hidden_by_an_encoding_are_not_read(tmp_path: Path) -> None:
    """UTF-16 is no UTF-8, and an XML declaration cannot make it so."""
    path = tmp_path / "a.kml"
    path.write_bytes('<?xml version="1.0"?><!DOCTYPE kml><kml/>'.encode("utf-16"))
    with pytest.raises(ConfigError, match="is not UTF-8"):
        read_areas(path)
    path.write_bytes(b'<?xml version="1.0" encoding="utf-7"?><kml>+ADwAIQ-</kml>')
    with pytest.raises(ConfigError):
        read_areas(path)


def test_a_compressed_file_is_told_as_such(tmp_path: Path) -> None:
    """A KMZ is a zip, which is not unpacked."""
    with pytest.raises(ConfigError, match=r"a\.kmz is compressed: unpack it"):
        read_areas(tmp_path / "a.kmz")


degree = st.floats(-0.01, 0.01)


@given(st.lists(st.tuples(degree, degree), min_size=3, max_size=9, unique=True))
def test_both_formats_are_read_alike(
    tmp_path_factory: pytest.TempPathFactory, corners: list[tuple[float, float]]
) -> None:
    """The same corners make the same area."""
    folder = tmp_path_factory.mktemp("areas")
    ring = [[8 + east, 47 + north] for east, north in corners]
    if len({tuple(at) for at in ring}) < len(ring):
        return
    one = read_areas(geojson(folder / "a.json", polygon(ring)))
    two = read_areas(kml(folder / "a.kml", f"<Polygon>{kml_ring(ring, 'outer')}</Polygon>"))
    assert one == two
    assert len(one[0].outline) == len(corners)
