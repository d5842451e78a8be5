"""Elevation files: what is read of them, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from elevation_files import hgt, hilly, write_geotiff
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.config.model import TerrainConfig
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.terrain.ground import Ground, agreed_sea_level
from aerodaas.terrain.terrain import Terrain

Array = NDArray[np.float64]


def _sloping(latitudes: Array, longitudes: Array) -> Array:
    """A plane, which bilinear interpolation has exactly where its samples are whole metres."""
    return 1200.0 * (latitudes - 46.0) + 2400.0 * (longitudes - 7.0) + 100.0


@pytest.mark.parametrize("side", [1201, 3601])
def test_hgt_tiles_are_interpolated_between_their_samples(tmp_path: Path, side: int) -> None:
    """At 3 and at 1 arc second, up to the very edges; the first row is the north."""
    step = 1.0 / (side - 1)
    terrain = Terrain.open(
        [hgt(tmp_path, "N47E008", lambda y, x: np.rint((y - 47) / step) % 7 * 10 + 0 * x, side)]
    )
    for row, share in ((0, 0.0), (3, 0.25), (6, 0.5), (side - 2, 1.0)):
        here, above = row % 7 * 10, (row + 1) % 7 * 10
        wanted = here + share * (above - here)
        found = terrain.height(47 + (row + share) * step, 8.3)
        assert found == pytest.approx(wanted, abs=1e-3)


@given(latitude=st.floats(46.0, 48.0), longitude=st.floats(7.0, 9.0))
def test_tiles_join_without_a_seam(latitude: float, longitude: float, four_tiles: Terrain) -> None:
    """A plane over four tiles is a plane at their common edges, too."""
    exact = float(_sloping(np.array(latitude), np.array(longitude)))
    assert four_tiles.height(latitude, longitude) == pytest.approx(exact, abs=1.0)


@pytest.fixture(scope="module")
def four_tiles(tmp_path_factory: pytest.TempPathFactory) -> Terrain:
    """Around 47 N, 8 E."""
    folder = tmp_path_factory.mktemp("tiles")
    names = ("N46E007", "N46E008", "N47E007", "N47E008")
    return Terrain.open([hgt(folder, name, _sloping) for name in names])


def test_southern_and_western_names_are_negative(tmp_path: Path) -> None:
    """The corner is the south-western one there, too."""
    terrain = Terrain.open([hgt(tmp_path, "S34W059", lambda y, x: 50.0 - y + 0 * x)])
    assert terrain.height(-33.5, -58.5) == pytest.approx(83.5, abs=0.6)
    with pytest.raises(ConfigError, match="do not reach it"):
        terrain.height(33.5, -58.5)


def test_a_hole_is_unknown_and_told_never_zero(tmp_path: Path) -> None:
    """All around it as well: no height is made of a void sample."""
    step = 1 / 1200

    def holed(latitudes: Array, longitudes: Array) -> Array:
        there = (abs(latitudes - 47.5) < step / 2) & (abs(longitudes - 8.5) < step / 2)
        return np.where(there, np.nan, 300.0)

    terrain = Terrain.open([hgt(tmp_path, "N47E008", holed)])
    for north, east in ((0.0, 0.0), (0.9, 0.0), (-0.5, 0.5), (0.0, -0.99)):
        with pytest.raises(ConfigError, match=r"N47E008\.hgt has a hole there; fill it"):
            terrain.height(47.5 + north * step, 8.5 + east * step)
    for north, east in ((1.0, 0.0), (0.0, 1.0), (1.5, 0.2), (1.0, 0.5)):
        assert terrain.height(47.5 + north * step, 8.5 + east * step) == pytest.approx(300.0)


def test_another_file_fills_a_hole(tmp_path: Path) -> None:
    """The first that knows a sample gives it."""
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    files = [
        hgt(first, "N47E008", lambda y, x: np.where(y > 47.5, np.nan, 100.0 + 0 * x)),
        hgt(second, "N47E008", lambda y, x: 200.0 + 0 * y * x),
    ]
    terrain = Terrain.open(files)
    assert terrain.height(47.75, 8.5) == pytest.approx(200.0)
    assert terrain.height(47.25, 8.5) == pytest.approx(100.0)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.sampled_from(["N47E008.hgt", "N47E008.tif", "x.hgt"]), content=st.binary())
def test_nonsense_is_refused_with_a_clear_error(tmp_path: Path, name: str, content: bytes) -> None:
    """Whatever the bytes, the error names the file and nothing else comes out."""
    path = tmp_path / name
    path.write_bytes(content)
    if name.endswith(".tif"):
        pytest.importorskip("tifffile")
    with pytest.raises(ConfigError, match=name):
        Terrain.open([path]).height(47.5, 8.5)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("N47E008.hgt.zip", "unpacked"),
        ("N91E008.hgt", "no place on Earth"),
        ("missing.hgt", "no terrain file lies at"),
    ],
)
def test_files_that_are_no_terrain_are_refused(tmp_path: Path, name: str, why: str) -> None:
    """By name, with the remedy."""
    path = tmp_path / name
    if "missing" not in name:
        path.write_bytes(bytes(2 * 1201 * 1201))
    with pytest.raises(ConfigError, match=why):
        Terrain.open([path])


def test_two_files_of_one_tile_are_told_apart_by_folder_and_steps(tmp_path: Path) -> None:
    """Their names are the same."""
    (tmp_path / "coarse").mkdir()
    (tmp_path / "fine").mkdir()
    coarse = hgt(tmp_path / "coarse", "N47E008", _sloping)
    fine = hgt(tmp_path / "fine", "N47E008", _sloping, 3601)
    with pytest.raises(ConfigError) as refused:
        Terrain.open([coarse, fine])
    for word in (f"{coarse} (steps of 3 x 3 arc", f"{fine} (steps of 1 x 1 arc"):
        assert word in str(refused.value)


def test_files_of_different_steps_are_not_joined(tmp_path: Path) -> None:
    """A seam between them would be guessed."""
    coarse = hgt(tmp_path, "N46E008", _sloping)
    fine = hgt(tmp_path, "N47E008", _sloping, 3601)
    with pytest.raises(ConfigError, match="different grids"):
        Terrain.open([coarse, fine])


def _slope(rows: int, columns: int, kind: str = "float32") -> NDArray[np.generic]:
    """10 m a row to the south, 1 m a column to the east."""
    return (10.0 * np.arange(rows)[:, None] + np.arange(columns)[None, :]).astype(kind)


@pytest.mark.parametrize("tie", ["middle", "corner"])
@pytest.mark.parametrize("kind", ["int16", "float32", "float64"])
def test_geotiff_samples_lie_where_its_keys_say(
    tmp_path: Path,
    tie: str,
    kind: str,
) -> None:
    """At the tie point, or half a pixel south-east of it."""
    pytest.importorskip("tifffile")
    path = write_geotiff(
        tmp_path / "a.tif", _slope(40, 50, kind), 47.4, 8.0, 0.01, point=tie == "middle"
    )
    shift = 0.0 if tie == "middle" else 0.005
    terrain = Terrain.open([path])
    found = terrain.height(47.4 - shift - 0.105, 8.0 + shift + 0.203)
    assert found == pytest.approx(105.0 + 20.3, abs=1e-3)
    with pytest.raises(ConfigError, match="do not reach it"):
        terrain.height(47.4 - shift + 0.001, 8.1)


@pytest.mark.parametrize(
    ("compression", "words"),
    [("deflate", {"predictor": 3, "tile": (16, 16)}), ("lzw", {"predictor": 2}), (None, {})],
)
def test_geotiff_is_read_as_it_is_usually_packed(
    tmp_path: Path, compression: str | None, words: dict[str, Any]
) -> None:
    """Copernicus has a floating-point predictor and tiles, others LZW, or nothing."""
    pytest.importorskip("imagecodecs")
    kind = "int16" if compression == "lzw" else "float32"
    path = write_geotiff(
        tmp_path / "a.tif", _slope(40, 50, kind), 47.4, 8.0, 0.01, compression=compression, **words
    )
    assert Terrain.open([path]).height(47.295, 8.205) == pytest.approx(120.0, abs=1e-3)


@pytest.mark.parametrize("nodata", ["-9999", "-32768", "0", "-3.4028234663852886e+38", None])
def test_geotiff_holes_are_unknown(tmp_path: Path, nodata: str | None) -> None:
    """By the file's own word for them, and by heights that no land has."""
    pytest.importorskip("tifffile")
    samples = _slope(9, 9) + np.float32(5.0)
    samples[4, 4] = np.nan if nodata is None else float(nodata)
    path = write_geotiff(tmp_path / "a.tif", samples, 47.09, 8.0, 0.01, point=True, nodata=nodata)
    with pytest.raises(ConfigError, match="has a hole there"):
        Terrain.open([path]).height(47.052, 8.041)


UNIT = '<Item name="UNITTYPE" sample="0" role="unittype">{}</Item>'
SCALED = (
    '<Item name="OFFSET" sample="0" role="offset">{1}</Item>'
    '<Item name="SCALE" sample="0" role="scale">{0}</Item>'
)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (UNIT.format("ft"), "UNITTYPE ft"),
        (SCALED.format(0.1, 0), "SCALE 0.1"),
        (SCALED.format(1, 5), "OFFSET 5"),
        (SCALED.format("ten", 0), "SCALE ten"),
        (SCALED.format("nan", 0), "SCALE nan"),
        ("<Item", "is no XML"),
    ],
)
def test_geotiff_heights_that_are_not_in_metres_are_refused(
    tmp_path: Path, words: str, why: str
) -> None:
    """As GDAL says in the file."""
    pytest.importorskip("tifffile")
    path = write_geotiff(tmp_path / "a.tif", _slope(9, 9), 47.0, 8.0, 0.01, gdal=words)
    with pytest.raises(ConfigError, match=rf"a\.tif: .*{why}.*gdal_calc"):
        Terrain.open([path])


@pytest.mark.parametrize(("unit", "fits"), [("metre", True), ("ft", False)])
def test_what_gdal_says_beside_a_geotiff_counts(tmp_path: Path, unit: str, *, fits: bool) -> None:
    """Where it could not write into the file."""
    pytest.importorskip("tifffile")
    path = write_geotiff(tmp_path / "a.tif", _slope(9, 9, "int16"), 47.09, 8.0, 0.01, point=True)
    (tmp_path / "a.tif.aux.xml").write_text(
        f'<PAMDataset><PAMRasterBand band="1"><UnitType>{unit}</UnitType>'
        "<Offset>0</Offset><Scale>1</Scale></PAMRasterBand></PAMDataset>"
    )
    if fits:
        assert Terrain.open([path]).height(47.04, 8.03) == pytest.approx(53.0, abs=1e-3)
        return
    with pytest.raises(ConfigError, match="not in metres"):
        Terrain.open([path])


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({3072: 32632}, "EPSG:32632.*gdalwarp"),
        ({2048: 4979}, "EPSG:4979"),
        ({4096: 4979}, "heights have the datum EPSG:4979"),
        ({4099: 9002}, "not in metres"),
    ],
)
def test_geotiff_of_other_coordinates_is_refused(
    tmp_path: Path, keys: dict[int, int], why: str
) -> None:
    """Projected ones, heights above the ellipsoid, and feet."""
    pytest.importorskip("tifffile")
    path = write_geotiff(tmp_path / "a.tif", _slope(9, 9), 47.0, 8.0, 0.01, keys=keys)
    with pytest.raises(ConfigError, match=why):
        Terrain.open([path])


@pytest.mark.parametrize("words", [{}, {"tile": (16, 16)}, {"compression": "deflate"}])
def test_a_geotiff_that_is_cut_short_is_refused(tmp_path: Path, words: dict[str, Any]) -> None:
    """What is missing at its end is not read as zeros."""
    pytest.importorskip("imagecodecs")
    path = write_geotiff(tmp_path / "a.tif", _slope(60, 60), 47.6, 8.0, 0.01, **words)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ConfigError, match="cut short"):
        Terrain.open([path])


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_broken_geotiff_is_refused_or_read_as_far_as_it_is_whole(
    tmp_path: Path, data: st.DataObject
) -> None:
    """Cut short or with bytes changed: ConfigError, or a height of land."""
    pytest.importorskip("tifffile")
    path = tmp_path / "a.tif"
    path.unlink(missing_ok=True)
    content = bytearray(
        write_geotiff(path, _slope(9, 9), 47.09, 8.0, 0.01, compression="deflate").read_bytes()
    )
    for _ in range(data.draw(st.integers(0, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        height = Terrain.open([path]).height(47.05, 8.04)
    except ConfigError as error:
        assert "a.tif" in str(error)  # noqa: PT017 - a change may do no harm
    else:
        assert -500.0 <= height <= 9000.0


@given(
    latitude=st.floats(-65.0, 65.0),
    east=st.floats(-5000.0, 5000.0),
    north=st.floats(-5000.0, 5000.0),
)
def test_places_of_the_local_frame_are_found_on_the_globe(
    latitude: float, east: float, north: float
) -> None:
    """As the geodetic frame has them, to a fraction of any terrain's step."""
    origin = GeodeticOrigin(latitude, 8.5, 500.0)
    ground = object.__new__(Ground)
    ground._pin(origin)
    found = ground._degrees(np.array([east]), np.array([north]))
    exact = origin.to_geodetic(np.array([east, north, 0.0]))
    across = 111_320.0 * math.cos(math.radians(latitude))
    assert 111_320.0 * abs(found[0][0] - exact[0]) < 0.2
    assert across * abs(found[1][0] - exact[1]) < 0.2


def test_heights_are_differences_from_the_ground_of_the_take_off(tmp_path: Path) -> None:
    """So that a terrain that is too high everywhere, or on another datum, does no harm."""
    raised = hgt(tmp_path, "N47E008", lambda y, x: hilly(y, x) + 47.0)
    origin = GeodeticOrigin(47.1, 8.1)
    takeoff = np.array([30.0, -40.0, 2.0])
    ground = Ground(Terrain.open([raised]), origin, takeoff, 500.0)
    assert ground.height(30.0, -40.0) == pytest.approx(2.0, abs=1e-6)
    there, here = (
        hilly(np.array(at[0]), np.array(at[1]))
        for at in (
            origin.to_geodetic(np.array([200.0, 100.0, 0.0])),
            origin.to_geodetic(takeoff),
        )
    )
    assert math.isnan(ground.height(5000.0, 0.0))
    assert ground.height(200.0, 100.0) == pytest.approx(2.0 + float(there - here), abs=8.0)


def test_a_terrain_and_a_home_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    """A height above the ellipsoid, given as above the sea, differs by the geoid's."""
    files = [str(hgt(tmp_path, "N47E008", lambda y, x: 540.0 + 0 * y * x))]
    config, origin = TerrainConfig(files=files), GeodeticOrigin(47.1, 8.1)
    standing = np.zeros(3)
    Ground.of(config, origin, standing, 500.0, sea_level=555.0)
    with pytest.raises(ConfigError, match="above the ellipsoid"):
        Ground.of(config, origin, standing, 500.0, sea_level=588.0)


def test_the_vehicles_word_for_the_sea_is_held_against_the_files() -> None:
    """Either is enough; where both are given, they agree within the errors of a GPS."""
    assert agreed_sea_level(None, None) is None
    assert agreed_sea_level(None, 480.0) == 480.0
    assert agreed_sea_level(488.0, None) == 488.0
    assert agreed_sea_level(488.0, 470.0) == 488.0
    with pytest.raises(ConfigError, match="535 m above the sea by the environment file, and 488"):
        agreed_sea_level(535.0, 488.0)


def test_a_take_off_over_unknown_ground_is_refused(tmp_path: Path) -> None:
    """Nothing could be told of any height from there."""
    terrain = Terrain.open([hgt(tmp_path, "N47E008", hilly)])
    with pytest.raises(ConfigError, match=r"at the take-off, the ground at .* do not reach it"):
        Ground(terrain, GeodeticOrigin(46.9, 8.1), np.zeros(3), 500.0)
