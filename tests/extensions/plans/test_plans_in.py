"""Plans become waypoints; what they mean besides is said; what cannot be flown is refused."""

from __future__ import annotations

import contextlib
import json
import math
import warnings
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plan_files import item, lines, mavwp, plan, survey, waypoint

from aerodaas import AeroNavigation, HeightReference, WaypointType
from aerodaas.errors import AeroDaaSError, ConfigError
from aerodaas.extensions.plans.commands import command_name
from aerodaas.extensions.plans.navigation import flown_plan, read_plan
from aerodaas.extensions.plans.plan import Plan, PlanItem
from aerodaas.extensions.plans.waypoints_in import waypoints_of
from aerodaas.geometry.frames import GeodeticOrigin

HOME = GeodeticOrigin(47.0, 8.0, 535.0)
"""The environment's; its altitude is above the ellipsoid, and no height depends on it."""


def told(path: Path, **more: Any) -> list[str]:  # noqa: ANN401
    """What a plan leaves out."""
    return [str(notice) for notice in flown_plan(path, **more)[1]]


def test_a_plan_of_qgroundcontrol_becomes_waypoints(tmp_path: Path) -> None:
    """Places, heights above home, hover times, speeds and headings; a survey's among them."""
    path = plan(
        tmp_path / "survey.plan",
        item(22, [0, 0, 0, None, 47, 8, 9]),
        item(16, [4, 0, 0, None, 47.0009, 8.0, 20]),
        item(178, [1, 3, -1, 0, 0, 0, 0], 2),
        survey(item(16, [0, 0, 0, 90, 47.0, 8.001, 500], 0)),
        item(20, [0] * 7, 2),
    )
    with pytest.warns(UserWarning, match="not everything in this plan is done") as warned:
        navigation = AeroNavigation.from_plan(path)
    assert len(warned) == 1
    assert warned[0].filename == __file__
    assert "item 1: NAV_TAKEOFF: climbs to limits.takeoff_height, not to 9 m" in str(
        warned[0].message
    )
    first, second = [one.resolve(None, HOME) for one in navigation.waypoints]  # type: ignore[arg-type]
    assert first.position == pytest.approx([0.0, 100.06, 20.0], abs=0.01)
    assert (first.id, first.hover_duration, first.speed, first.yaw) == ("item2", 4.0, None, None)
    assert second.position == pytest.approx([76.06, 0.0, 12.0], abs=0.01)
    assert (second.id, second.speed) == ("item4", 3.0)
    assert second.yaw == pytest.approx(0.0)


def test_a_plan_of_which_all_is_flown_warns_of_nothing(tmp_path: Path) -> None:
    """Waypoints, speeds and a return are what missions are made of."""
    path = plan(tmp_path / "a.plan", waypoint(0.001), item(20, [0] * 7, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(AeroNavigation.from_plan(path)) == 1


def test_global_relative_needs_a_home(tmp_path: Path) -> None:
    """The environment's, when it is flown; its message says so."""
    (one,) = AeroNavigation.from_plan(plan(tmp_path / "a.plan", waypoint(0.001))).waypoints
    assert one.waypoint_type is WaypointType.GLOBAL_RELATIVE
    with pytest.raises(AeroDaaSError, match="the environment file gives no home"):
        one.resolve(None, None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("command", "line"),
    [
        (202, "items 2, 3: DO_DIGICAM_CONFIGURE: no picture is taken"),
        (530, "items 2, 3: SET_CAMERA_MODE: no picture is taken"),
        (204, "items 2, 3: DO_MOUNT_CONFIGURE: no gimbal is moved"),
        (196, "items 2, 3: DO_SET_ROI_WPNEXT_OFFSET: no gimbal is moved"),
        (183, "items 2, 3: DO_SET_SERVO: no payload is moved"),
        (177, "items 2, 3: DO_JUMP: the way is flown once"),
        (115, "items 2, 3: CONDITION_YAW: the drone does not turn"),
        (189, "items 2, 3: DO_LAND_START: it is not carried out"),
        (60_000, "items 2, 3: command 60000: it is not carried out"),
    ],
)
def test_what_is_not_done_is_said(tmp_path: Path, command: int, line: str) -> None:
    """By number, MAVLink's name and reason; one line for equal ones."""
    does = item(command, [1, 2, 3, 4, 5, 6, 7], 2)
    path = plan(tmp_path / "a.plan", waypoint(0.001), does, does, waypoint(0.002))
    assert [one.id for one in flown_plan(path)[0]] == ["item1", "item4"]
    (notice,) = told(path)
    assert notice.startswith(line)


def test_no_item_vanishes() -> None:
    """Every command that says what to do on the way has a name and a word of what becomes of it."""
    for command in [*range(96, 3000), *range(30_000, 44_000)]:
        done = PlanItem(1, command, 2, (9.0, 1.0, 1.0, 1.0), 1.0, 1.0, 1.0)
        waypoints, notices = waypoints_of(Plan((done,)))
        assert not waypoints
        named = {command_name(command)} - {"IMAGE_STOP_CAPTURE"}
        assert {one.command for one in notices} == named


@pytest.mark.parametrize(
    ("params", "speed", "said"),
    [
        ([1, 4, -1, 0], 4.0, False),
        ([0, 4, -1, 0], 4.0, False),
        ([None, 4, -1, 0], 4.0, False),
        ([1, -1, -1, 0], 2.0, False),
        ([1, None, -1, 0], 2.0, False),
        ([1, -2, -1, 0], None, False),
        ([1, 0, -1, 0], 2.0, True),
        ([2, 4, -1, 0], 2.0, True),
        ([3, 4, -1, 0], 2.0, True),
        ([1, 4, 60, 0], 4.0, True),
        ([1, -1, 60, 0], 2.0, True),
        ([1, 4, -2, 0], 4.0, False),
        ([1, 4, 0, 0], 4.0, False),
        ([1, 4, -1, 1], 2.0, True),
    ],
)
def test_speeds(tmp_path: Path, params: list[Any], speed: float | None, said: bool) -> None:  # noqa: FBT001
    """Those through the air and over ground count; others, and a throttle, are told."""
    before = item(178, [1, 2, -1, 0, 0, 0, 0], 2)
    change = item(178, [*params, 0, 0, 0], 2)
    path = plan(tmp_path / "a.plan", before, change, waypoint(0.001))
    ((one,), notices) = flown_plan(path)
    assert one.speed == speed
    assert [notice.command for notice in notices] == ["DO_CHANGE_SPEED"] * said


def test_waiting(tmp_path: Path) -> None:
    """Delays and loitering lengthen the stay at the waypoint before; times of day are said."""
    loiter = item(19, [5, 0, 0, 0, 47.002, 8.0, 9])
    path = plan(
        tmp_path / "a.plan",
        item(93, [7, 0, 0, 0, 0, 0, 0], 2),
        waypoint(0.001, hover=1),
        item(93, [10, 0, 0, 0, 0, 0, 0], 2),
        item(93, [-1, 12, 30, 0, 0, 0, 0], 2),
        loiter,
        item(19, [3, 0, 0, 0, 0, 0, 9]),
    )
    waypoints, notices = flown_plan(path)
    assert [one.hover_duration for one in waypoints] == [11.0, 8.0]
    assert [(one.numbers, one.command) for one in notices] == [
        ((1,), "NAV_DELAY"),
        ((4,), "NAV_DELAY"),
    ]


def test_what_a_waypoint_says_beside_its_place(tmp_path: Path) -> None:
    """Radii, splines, and an item after which nobody goes on."""
    path = plan(
        tmp_path / "a.plan",
        item(16, [0, 3.0, 0, None, 47.001, 8.0, 9]),
        item(82, [2, 0, 0, None, 47.002, 8.0, 9]),
        item(16, [0, 0, 0, None, 47.003, 8.0, 9], autoContinue=False),
    )
    assert told(path) == [
        "item 1: NAV_WAYPOINT: its radius (params 2, 3) is not used, but limits.arrival_radius",
        "item 2: NAV_SPLINE_WAYPOINT: flown straight",
        "item 3: NAV_WAYPOINT: the drone goes on, though autoContinue is false",
    ]
    assert flown_plan(path)[0][1].hover_duration == 2.0


def test_headings_are_px4s(tmp_path: Path) -> None:
    """ArduPilot has none at a waypoint, where its writers put a zero."""
    north = item(16, [0, 0, 0, 0, 47.001, 8.0, 9])
    px4 = plan(tmp_path / "px4.plan", north)
    assert flown_plan(px4)[0][0].yaw == pytest.approx(math.pi / 2)
    ardupilot = plan(tmp_path / "ardupilot.plan", north, mission={"firmwareType": 3})
    assert flown_plan(ardupilot)[0][0].yaw is None
    assert not told(ardupilot)
    east = plan(
        tmp_path / "east.plan", item(16, [0, 0, 0, 90, 47, 8, 9]), mission={"firmwareType": 3}
    )
    assert flown_plan(east)[0][0].yaw is None
    assert "its yaw (param 4) is not used" in told(east)[0]
    assert (
        flown_plan(lines(tmp_path / "a.waypoints", "3 16 0 0 0 0 47.001 8.0 9"))[0][0].yaw is None
    )


def test_the_end_of_a_plan(tmp_path: Path) -> None:
    """Nothing is flown after a return; a landing is at home; after one, nothing more is flown."""
    back = item(20, [0] * 7, 2)
    path = plan(tmp_path / "a.plan", waypoint(0.001), back, waypoint(0.002))
    assert [one.id for one in flown_plan(path)[0]] == ["item1"]
    assert told(path) == [
        "item 3: NAV_WAYPOINT: stands after NAV_RETURN_TO_LAUNCH, which ends the flight"
    ]
    down = item(21, [0, 0, 0, 0, 47.001, 8.0, 0])
    path = plan(tmp_path / "b.plan", waypoint(0.001), down)
    assert told(path) == ["item 2: NAV_LAND: the drone comes back to its take-off and lands there"]
    with pytest.raises(ConfigError, match=r"item 3: NAV_WAYPOINT stands after NAV_LAND.*two plans"):
        flown_plan(plan(tmp_path / "c.plan", waypoint(0.001), down, waypoint(0.002)))


@pytest.mark.parametrize("command", [17, 18, 30, 31, 94])
def test_what_leads_elsewhere_is_refused(tmp_path: Path, command: int) -> None:
    """A way with a part left out would be another way."""
    path = plan(tmp_path / "a.plan", waypoint(0.001), item(command, [1, 1, 1, 1, 47, 8, 9]))
    with pytest.raises(ConfigError, match=rf"item 2: {command_name(command)} cannot be flown"):
        flown_plan(path)


@pytest.mark.parametrize("frame", [0, 5])
def test_heights_above_the_sea(tmp_path: Path, frame: int) -> None:
    """Less that of home: the plan's own, or the given; with neither, for the mission to say."""
    path = plan(tmp_path / "a.plan", waypoint(0.001, 500.0, frame))
    assert flown_plan(path)[0][0].z == pytest.approx(12.0)
    assert flown_plan(path, home_altitude=480.0)[0][0].z == pytest.approx(20.0)
    unknown = [[None, None, None], [0, 0, 0], [47.0, 8.0, None], [47.0, 8.0], [47.0, 8.0, 0]]
    for home in (None, *unknown):
        path = plan(tmp_path / "b.plan", waypoint(0.001, 500.0, frame), home=home)
        (one,) = flown_plan(path)[0]
        assert (one.z, one.above) == (500.0, HeightReference.SEA)
        assert flown_plan(path, home_altitude=480.0)[0][0].z == pytest.approx(20.0)


@pytest.mark.parametrize("frame", [3, 6])
def test_heights_above_home_need_nothing(tmp_path: Path, frame: int) -> None:
    """Neither a home in the plan nor a ground, and what is given changes nothing."""
    path = plan(tmp_path / "a.plan", waypoint(0.001, 20.0, frame), home=None)
    assert flown_plan(path, home_altitude=99.0)[0][0].z == 20.0


@pytest.mark.parametrize("frame", [10, 11])
def test_heights_above_ground(tmp_path: Path, frame: int) -> None:
    """Above its height there; where that is not given, the environment's terrain is to know."""
    path = plan(tmp_path / "a.plan", waypoint(0.001, 20.0, frame))
    (one,) = flown_plan(path)[0]
    assert (one.z, one.above) == (20.0, HeightReference.GROUND)
    asked: list[tuple[float, float]] = []

    def ground(latitude: float, longitude: float) -> float:
        asked.append((latitude, longitude))
        return 510.0

    assert AeroNavigation.from_plan(path, ground=ground).waypoints[0].z == pytest.approx(42.0)
    assert asked == [(47.001, 8.0)]
    with pytest.raises(ConfigError, match="height of the ground must be a finite number"):
        flown_plan(path, ground=lambda *_: math.nan)


def test_heights_above_a_terrain_that_was_not_known(tmp_path: Path) -> None:
    """They are above the ground, as their author meant, and not above the sea."""
    mode = {"AltitudeMode": 3, "Altitude": 76.0}
    for z in (76.0, None):
        params = [0, 0, 0, None, 47.001, 8.0, z]
        path = plan(tmp_path / "a.plan", item(16, params, 0, AMSLAltAboveTerrain=None, **mode))
        (one,) = flown_plan(path)[0]
        assert (one.z, one.above) == (76.0, HeightReference.GROUND)
        (one,) = flown_plan(path, home_altitude=20.0, ground=lambda *_: 25.0)[0]
        assert (one.z, one.above) == (81.0, None)
    known = item(16, [0, 0, 0, None, 47.001, 8.0, 536.0], 0, AMSLAltAboveTerrain=536.0, **mode)
    (one,) = flown_plan(plan(tmp_path / "b.plan", known), home_altitude=460.0)[0]
    assert one.z == pytest.approx(76.0)


@pytest.mark.parametrize(
    ("frame", "mode", "more", "flown"),
    [
        (3, 1, {}, True),
        (3, 0, {}, True),
        (6, 1, {}, True),
        (0, 2, {}, True),
        (10, 4, {}, True),
        (0, 3, {"AMSLAltAboveTerrain": 20.0}, True),
        (3, 2, {}, False),
        (3, 3, {"AMSLAltAboveTerrain": None}, False),
        (3, 4, {}, False),
        (0, 0, {}, False),
        (0, 1, {}, False),
        (0, 4, {}, False),
        (10, 1, {}, False),
        (10, 3, {}, False),
        (3, 5, {}, False),
        (3, 99, {}, False),
        (3, 1, {"Altitude": 50.0}, False),
        (0, 2, {"Altitude": 50.0}, False),
        (0, 3, {"AMSLAltAboveTerrain": 50.0}, False),
        (0, 3, {"AMSLAltAboveTerrain": None, "Altitude": None}, False),
    ],
)
def test_an_altitude_mode_agrees_with_its_item(
    tmp_path: Path,
    frame: int,
    mode: int,
    more: dict[str, Any],
    flown: bool,  # noqa: FBT001
) -> None:
    """Frame and number say what the mode says, or the plan is refused, by item."""
    params = [0, 0, 0, None, 47.001, 8.0, 20.0]
    entry = item(16, params, frame, **{"AltitudeMode": mode, "Altitude": 20.0} | more)
    for entries in ((entry,), (survey(entry),)):
        path = plan(tmp_path / "a.plan", *entries)
        if flown:
            assert len(read_plan(path).items) == 1
        else:
            with pytest.raises(ConfigError, match="item 1"):
                read_plan(path)


@pytest.mark.parametrize("frame", [1, 2, 4, 7, 12, 99])
def test_other_frames_are_refused(tmp_path: Path, frame: int) -> None:
    """A height in them is none above home."""
    with pytest.raises(ConfigError, match=f"item 1: frame {frame} is not known"):
        flown_plan(plan(tmp_path / "a.plan", waypoint(0.001, 20.0, frame)))


@pytest.mark.parametrize(
    ("params", "why"),
    [
        ([0, 0, 0, None, 0, 0, 9], "NAV_WAYPOINT has no place"),
        ([0, 0, 0, None, None, None, 9], "NAV_WAYPOINT has no place"),
        ([0, 0, 0, None, 47, None, 9], "longitude must be a finite number, not None"),
        ([0, 0, 0, None, 91, 8, 9], "is no latitude and longitude in degrees"),
        ([0, 0, 0, None, 47, 181, 9], "is no latitude and longitude in degrees"),
        ([0, 0, 0, None, 47, 8, None], r"altitude \(param 7\) must be a finite number"),
        ([-1, 0, 0, None, 47, 8, 9], "cannot hold for -1 s"),
        ([0, 0, 0, None, "47", 8, 9], "param 5 must be a finite number, not '47'"),
        ([0, 0, 0, True, 47, 8, 9], "param 4 must be a finite number, not True"),
        ([0, 0, 0, None, 47, 8], "has 6 params, not 7"),
    ],
)
def test_a_waypoint_that_is_none(tmp_path: Path, params: list[Any], why: str) -> None:
    """Refused, with file and number."""
    with pytest.raises(ConfigError, match=rf"a.plan cannot .*item 1.*{why}"):
        flown_plan(plan(tmp_path / "a.plan", item(16, params)))


@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_without_end_are_refused(tmp_path: Path, word: str) -> None:
    """Python's JSON knows them, a plan does not."""
    path = plan(tmp_path / "a.plan", waypoint(0.001, 12345.0))
    path.write_text(path.read_text().replace("12345.0", word))
    with pytest.raises(ConfigError, match="must be a finite number"):
        flown_plan(path)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"fileType": "Mission"}, "fileType is 'Mission', not 'Plan': open it in a current"),
        ({"version": 2}, "version is 2, not 1: open it in a current"),
        ({"mission": {"version": 1}}, "mission.version is 1, not 2: open it in a current"),
        ({"mission": {"items": {}}}, "mission.items must be a list"),
        ({"mission": {"items": [3]}}, "item 1 must be an object"),
        ({"mission": {"items": [item(16.5, [0] * 7)]}}, "command must be a whole number"),  # type: ignore[arg-type]
        ({"mission": {"items": [item(*(True, [0] * 7))]}}, "command must be a whole number"),
        ({"mission": {"items": [item(16, [0] * 7, "3")]}}, "frame must be a whole number"),
        ({"mission": {"items": [item(16, [0] * 7, autoContinue=1)]}}, "must be true or false"),
        ({"mission": {"items": [survey()]}}, r"item 1 \(survey\) holds no items to fly"),
        ({"mission": {"items": [survey(survey())]}}, "item 1 is an item within an item"),
        ({"mission": {"items": [{"type": "ComplexItem", "complexItemType": "Tea"}]}}, "'Tea'"),
        ({"mission": {"items": [{"complexItemType": "StructureScan"}]}}, "with waypoints"),
        ({"mission": {"plannedHomePosition": [1]}}, "must be latitude, longitude and altitude"),
        ({"mission": {"plannedHomePosition": [95, 8, 0]}}, "is no latitude and longitude"),
        ({"mission": {"plannedHomePosition": [47, 8, "0"]}}, "altitude must be a finite number"),
    ],
)
def test_files_that_are_no_plan(tmp_path: Path, change: dict[str, Any], why: str) -> None:
    """Each with what is wrong, and where."""
    with pytest.raises(ConfigError, match=f"a.plan cannot be read as a plan: .*{why}"):
        read_plan(plan(tmp_path / "a.plan", **change))


def test_a_plan_has_bounds(tmp_path: Path) -> None:
    """A stranger's file is not read whole, nor followed as deep or as long as it likes."""
    path = tmp_path / "huge.plan"
    for content, why in (
        ("[" * 100_000, "nested more than"),
        (" " * (5 << 20), "larger than 4 MiB"),
    ):
        path.write_text(content)
        with pytest.raises(ConfigError, match=why):
            read_plan(path)
    few = [survey(*[waypoint(0.001)] * 4000) for _ in range(3)]
    short = json.dumps(few).replace(" ", "").replace('"autoContinue":true,"doJumpId":1,', "")
    path.write_text(f'{{"mission":{{"items":{short}}}}}'.replace('"command"', '"command"'))
    with pytest.raises(ConfigError, match="has more than 10000 items: split it"):
        read_plan(path)


@given(
    st.recursive(
        st.none() | st.floats() | st.booleans() | st.text(max_size=5) | st.integers(0, 200),
        lambda inner: (
            st.lists(inner, max_size=7)
            | st.dictionaries(
                st.sampled_from(
                    [
                        *("mission", "items", "type", "params", "plannedHomePosition", "geoFence"),
                        *("rallyPoints", "points", "polygons", "TransectStyleComplexItem", "Items"),
                    ]
                ),
                inner,
            )
        ),
        max_leaves=12,
    )
)
def test_what_is_no_plan_is_refused(tmp_path_factory: pytest.TempPathFactory, content: Any) -> None:  # noqa: ANN401
    """Any JSON: ConfigError, or an empty plan."""
    path = tmp_path_factory.mktemp("plans") / "x.plan"
    path.write_text(json.dumps(content))
    with contextlib.suppress(ConfigError):
        assert not flown_plan(path)[0]


def test_other_files_are_told_what_they_are(tmp_path: Path) -> None:
    """Areas have a reader of their own."""
    path = tmp_path / "x"
    path.write_text('<kml xmlns="http://www.opengis.net/kml/2.2"/>')
    with pytest.raises(ConfigError, match="it is XML; of KML, `read_areas`"):
        read_plan(path)
    path.write_text('{"type": "FeatureCollection", "features": []}')
    with pytest.raises(ConfigError, match="it is GeoJSON, of which `read_areas`"):
        read_plan(path)


ROWS = ["3 22 0 0 0 0 47.0 8.0 20", "3 16 2 0 0 0 47.001 8.0 20", "0 16 0 0 0 0 47.002 8.001 500"]


def test_a_plan_of_mission_planner_becomes_waypoints(tmp_path: Path) -> None:
    """Its line 0 is home, whose altitude those above the sea are counted from."""
    path = lines(tmp_path / "a.waypoints", *ROWS, "2 178 1 4 0 0 0 0 0", "3 16 0 0 0 0 47.1 8 5")
    waypoints, notices = flown_plan(path)
    assert [(one.id, one.x, one.y, one.z) for one in waypoints] == [
        ("item2", 47.001, 8.0, 20.0),
        ("item3", 47.002, 8.001, 12.0),
        ("item5", 47.1, 8.0, 5.0),
    ]
    assert [one.hover_duration for one in waypoints] == [2.0, 0.0, 0.0]
    assert [one.speed for one in waypoints] == [None, None, 4.0]
    assert [one.command for one in notices] == ["NAV_TAKEOFF"]


@pytest.mark.parametrize("home", ["0 0 0", "47 8 0"])
def test_a_home_of_zeros_is_none(tmp_path: Path, home: str) -> None:
    """Some writers know no home, or not its altitude: then the sea's level is not known either."""
    path = lines(tmp_path / "a.waypoints", *ROWS, home=home)
    assert [one.above for one in flown_plan(path)[0]] == [None, HeightReference.SEA]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("QGC WPL 120\n", "its first line is not 'QGC WPL 110'"),
        ("QGC WPL 110\n", "it holds no items"),
        # A take-off, a waypoint above home, and one above ground, each where home is to stand.
        ("QGC WPL 110\n0 1 3 22 0 0 0 0 47 8 10 1\n", "item 0 must be home.*NAV_TAKEOFF"),
        ("QGC WPL 110\n0 1 3 16 0 0 0 0 47 8 10 1\n", "item 0 must be home.*in frame 3"),
        ("QGC WPL 110\n0 1 10 16 0 0 0 0 47 8 10 1\n", "item 0 must be home.*in frame 10"),
        ("QGC WPL 110\n0 1 0 22 0 0 0 0 47 8 10 1\n", "item 0 must be home.*NAV_TAKEOFF"),
        ("QGC WPL 110\n1 0 3 16 0 0 0 0 47 8 9 1\n", "line 2 is item 1, not 0"),
        ("QGC WPL 110\n0 0 3 16 0 0 0 0 47 8 9\n", "line 2 has 11 fields, not 12"),
        ("QGC WPL 110\n0 0 3 16 0 0 nan 0 47 8 9 1\n", "field 7 must be a finite number, not nan"),
        ("QGC WPL 110\n0 0 3 16 0 0 inf 0 47 8 9 1\n", "field 7 must be a finite number"),
        ("QGC WPL 110\n0 0 3 16 0 0 1_0 0 47 8 9 1\n", "field 7 must be a number, not '1_0'"),
        ("QGC WPL 110\n0 0 3 16 0 0 x 0 47 8 9 1\n", "field 7 must be a number, not 'x'"),
        ("QGC WPL 110\n0 0 -3 16 0 0 0 0 47 8 9 1\n", "frame must be a whole number, not '-3'"),
        ("QGC WPL 110\n0 0 3 1\u0666 0 0 0 0 47 8 9 1\n", "command must be a whole number"),
        ("QGC WPL 110\n0 0 0 16 0 0 0 0 470 8 9 1\n", "home: .* is no latitude"),
    ],
)
def test_lines_that_are_no_items(tmp_path: Path, text: str, why: str) -> None:
    """Each with what is wrong, and in which line."""
    path = tmp_path / "a.waypoints"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=why):
        read_plan(path)


coordinate = st.floats(-80, 80).filter(lambda one: abs(one) > 1e-5)


@given(
    st.lists(
        st.tuples(
            st.sampled_from([16, 19, 178, 206, 22]),
            st.tuples(*[st.integers(0, 90)] * 4),
            coordinate,
            coordinate,
            st.floats(0, 100),
        ),
        max_size=12,
    )
)
def test_pymavlink_reads_the_same_lines(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[Any, ...]]
) -> None:
    """What its loader writes we read as it does, comments and all."""
    path = tmp_path_factory.mktemp("lines") / "a.waypoints"
    loader = mavwp.MAVWPLoader()
    text = [f"3 {c} {' '.join(map(str, p))} {x:.7f} {y:.7f} {z}" for c, p, x, y, z in rows]
    loader.load(str(lines(path, *text)))
    if loader.count() > 1:
        loader.wp(1).comment = "with a comment"
    loader.save(str(path))
    loader.load(str(path))
    read = read_plan(path)
    assert len(read.items) == loader.count() - 1
    for ours in read.items:
        theirs = loader.wp(ours.number)
        assert (ours.command, ours.frame) == (theirs.command, theirs.frame)
        assert ours.values == (theirs.param1, theirs.param2, theirs.param3, theirs.param4)
        assert (ours.x, ours.y, ours.z) == (theirs.x, theirs.y, theirs.z)


def test_parts_that_waypoints_do_not_hold_are_said(tmp_path: Path) -> None:
    """Fence, rally points, and patterns of landing."""
    fence = {"version": 2, "polygons": [], "circles": []}
    fence["circles"] = [{"inclusion": True, "circle": {"center": [47, 8], "radius": 90}}]
    path = plan(
        tmp_path / "a.plan",
        waypoint(0.001),
        {"type": "ComplexItem", "complexItemType": "vtolLandingPattern"},
        geoFence=fence,
        rallyPoints={"version": 2, "points": [[47, 8, 30]]},
    )
    assert [(one.numbers, one.command) for one in flown_plan(path)[1]] == [
        ((2,), "vtolLandingPattern"),
        ((), "rally points"),
        ((), "geofence"),
    ]
    old = plan(tmp_path / "b.plan", waypoint(0.001), geoFence={"version": 1, "polygon": [[1, 2]]})
    (notice,) = told(old)
    assert notice.startswith("geofence: its version is not 2 and it is not read; open it in a")


def test_a_warning_has_an_end(tmp_path: Path) -> None:
    """Hundreds of triggers are one line, many kinds a few; what a file says is printable."""
    many = [item(40_000 + index, [0] * 7, 2) for index in range(100)]
    with pytest.warns(UserWarning, match=r"and 80 more: `aerodaas plan show` lists them"):
        AeroNavigation.from_plan(plan(tmp_path / "a.plan", *many))
    servos = [item(183, [0] * 7, 2)] * 500
    (line,) = told(plan(tmp_path / "b.plan", *servos))
    assert line.startswith("items 1, 2, 3, 4, 5, 6, 7, 8 and 492 more: DO_SET_SERVO")
    path = plan(tmp_path / "c.plan", {"type": "\x1b[2J", "complexItemType": "\x1b[2J"})
    with pytest.raises(ConfigError) as raised:
        read_plan(path)
    assert "\x1b" not in str(raised.value)
