"""Waypoints become plans, and come back the same."""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plan_files import mavwp

from aerodaas import AeroNavigation, VelocityCommand, Waypoint
from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.navigation import flown_plan, read_plan
from aerodaas.geometry.frames import GeodeticOrigin, wrap_angle
from aerodaas.messages.waypoints import HeightReference, WaypointType

HOME = GeodeticOrigin(-35.363262, 149.165237, 584.0)
metres = st.floats(-2000.0, 2000.0)
local = st.builds(
    Waypoint,
    st.just("one"),
    metres,
    metres,
    st.floats(0.0, 400.0),
    hover_duration=st.floats(0.0, 600.0),
    waypoint_type=st.just("local"),
    yaw=st.none() | st.floats(-math.pi, math.pi),
    speed=st.none() | st.floats(0.1, 20.0),
)


def there_and_back(path: Path, flown: AeroNavigation) -> list[Waypoint]:
    """A file, read again, in the environment's frame."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        flown.to_plan(path, HOME)
        read = AeroNavigation.from_plan(path)
    return [one.resolve(np.zeros(3), HOME) for one in read.waypoints]


def numbered(waypoints: list[Waypoint]) -> AeroNavigation:
    """Each with an id of its own."""
    fields = ("x", "y", "z", "hover_duration", "waypoint_type", "yaw", "speed")
    return AeroNavigation(
        data=[
            Waypoint(f"w{index}", **{name: getattr(one, name) for name in fields})
            for index, one in enumerate(waypoints)
        ]
    )


@pytest.mark.parametrize("suffix", ["plan", "waypoints"])
@given(waypoints=st.lists(local, max_size=8))
def test_waypoints_come_back(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, waypoints: list[Waypoint]
) -> None:
    """Places and heights within a centimetre, speeds, stays; headings where a file has them."""
    path = tmp_path_factory.mktemp("out") / f"a.{suffix}"
    read = there_and_back(path, numbered(waypoints))
    assert len(read) == len(waypoints)
    for ours, came in zip(waypoints, read, strict=True):
        assert came.position == pytest.approx(ours.position, abs=0.01)
        assert came.hover_duration == pytest.approx(ours.hover_duration, abs=1e-6)
        assert came.speed == pytest.approx(ours.speed, abs=1e-6)
        if suffix == "waypoints" or ours.yaw is None:
            assert came.yaw is None
        else:
            assert came.yaw is not None
            assert wrap_angle(came.yaw - ours.yaw) == pytest.approx(0.0, abs=1e-9)


@given(
    waypoints=st.lists(
        st.builds(
            Waypoint,
            st.just("one"),
            st.floats(-35.38, -35.35),
            st.floats(149.15, 149.18),
            st.floats(0, 400),
            waypoint_type=st.just("global_relative"),
        ),
        min_size=1,
        max_size=5,
    )
)
def test_places_on_the_globe_come_back_to_the_last_digit(
    tmp_path_factory: pytest.TempPathFactory, waypoints: list[Waypoint]
) -> None:
    """What is read is what was written."""
    path = tmp_path_factory.mktemp("out") / "a.plan"
    numbered(waypoints).to_plan(path, HOME)
    read = flown_plan(path)[0]
    assert [(one.x, one.y, one.z) for one in read] == [(one.x, one.y, one.z) for one in waypoints]


def test_a_height_above_the_ellipsoid_is_none_above_the_sea(tmp_path: Path) -> None:
    """The altitude of the environment's home is not written as the sea's."""
    for name in ("a.plan", "a.waypoints"):
        AeroNavigation(data=[]).to_plan(tmp_path / name, HOME)
        home = read_plan(tmp_path / name).home
        assert home is not None
        assert home.altitude is None


def test_a_height_above_the_ellipsoid_is_written_above_home(tmp_path: Path) -> None:
    """It is what `global` waypoints have."""
    above = Waypoint("a", -35.36, 149.16, 600.0, waypoint_type=WaypointType.GLOBAL)
    AeroNavigation(data=[above]).to_plan(tmp_path / "a.plan", HOME)
    (one,) = flown_plan(tmp_path / "a.plan")[0]
    assert (one.x, one.y) == (-35.36, 149.16)
    assert one.z == pytest.approx(16.0)


@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
def test_a_waypoints_height_keeps_what_it_is_counted_from(tmp_path: Path, suffix: str) -> None:
    """Home, sea and ground come back as they were written."""
    asked = [
        Waypoint("a", 10, 0, 12, waypoint_type="local", above="home"),
        Waypoint("b", -35.36, 149.16, 650.0, waypoint_type="global", above="sea"),
        Waypoint("c", -35.36, 149.161, 30.0, waypoint_type="global_relative", above="ground"),
    ]
    path = tmp_path / f"a{suffix}"
    AeroNavigation(data=asked).to_plan(path, HOME)
    read = flown_plan(path)[0]
    assert [(one.z, one.above) for one in read] == [
        (12.0, None),
        (650.0, HeightReference.SEA),
        (30.0, HeightReference.GROUND),
    ]


def test_a_ground_station_shows_heights_by_their_reference(tmp_path: Path) -> None:
    """QGroundControl's modes: absolute and terrain frame, beside their MAVLink frames."""
    asked = [
        Waypoint("b", -35.36, 149.16, 650.0, waypoint_type="global", above="sea"),
        Waypoint("c", -35.36, 149.161, 30.0, waypoint_type="global", above="ground"),
    ]
    AeroNavigation(data=asked).to_plan(tmp_path / "a.plan", HOME)
    items = json.loads((tmp_path / "a.plan").read_text())["mission"]["items"]
    found = [(one["frame"], one["AltitudeMode"]) for one in items if one["command"] == 16]
    assert found == [(0, 2), (10, 4)]
    assert items[0]["params"][6] == 1.5


def test_what_a_ground_station_finds(tmp_path: Path) -> None:
    """A take-off to the first height, speeds where they change, waypoints, a return."""
    flown = [
        Waypoint("a", 10, 0, 12, waypoint_type="local", speed=3),
        Waypoint("b", 20, 0, 12, waypoint_type="local", speed=3, hover_duration=4, yaw=0.0),
        Waypoint("c", 30, 0, 12, waypoint_type="local"),
    ]
    path = tmp_path / "a.plan"
    AeroNavigation(data=flown).to_plan(path, HOME, home_altitude=584.5)
    content = json.loads(path.read_text())
    assert content["fileType"] == "Plan"
    assert content["mission"]["plannedHomePosition"] == [-35.363262, 149.165237, 584.5]
    items = content["mission"]["items"]
    assert [one["command"] for one in items] == [22, 178, 16, 16, 178, 16, 20]
    assert [one["doJumpId"] for one in items] == [1, 2, 3, 4, 5, 6, 7]
    assert items[0]["params"] == [0.0, 0.0, 0.0, None, -35.363262, 149.165237, 12]
    assert items[1]["params"][:3] == [1.0, 3, -1.0]
    assert items[3]["params"][:4] == [4, 0.0, 0.0, 90.0]
    assert items[4]["params"][:3] == [1.0, -2.0, -1.0]
    assert {one["frame"] for one in items if one["command"] == 16} == {3}


def test_pymavlink_reads_what_is_written(tmp_path: Path) -> None:
    """Its loader for `.waypoints`, item by item."""
    flown = [Waypoint("a", 10, 20, 12, waypoint_type="local", hover_duration=2, speed=3)]
    path = tmp_path / "a.waypoints"
    AeroNavigation(data=flown).to_plan(path, HOME, home_altitude=584.5)
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == 5
    home, takeoff, speed, there, back = [loader.wp(index) for index in range(5)]
    assert (home.command, home.frame, home.current) == (16, 0, 1)
    assert (home.x, home.y, home.z) == (-35.363262, 149.165237, 584.5)
    assert (takeoff.command, takeoff.z) == (22, 12.0)
    assert (speed.command, speed.param1, speed.param2) == (178, 1.0, 3.0)
    assert (there.command, there.frame, there.param1, there.z) == (16, 3, 2.0, 12.0)
    east, north, _ = HOME.to_local(there.x, there.y, HOME.altitude)
    assert (east, north) == (pytest.approx(10, abs=0.002), pytest.approx(20, abs=0.002))
    assert back.command == 20


@pytest.mark.parametrize(
    ("more", "suffix", "line"),
    [
        ({"priority": 1}, "plan", "priorities: a plan holds none; 1 waypoints had one: a"),
        ({"deadline": 9.0}, "plan", "deadlines: a plan holds none; 1 waypoints had one: a"),
        ({"yaw": 1.0}, "waypoints", "item 2: NAV_WAYPOINT: ArduPilot does not turn"),
    ],
)
def test_what_a_file_cannot_hold_is_said(
    tmp_path: Path, more: dict[str, Any], suffix: str, line: str
) -> None:
    """By one warning."""
    flown = AeroNavigation(data=[Waypoint("a", 1, 2, 3, waypoint_type="local", **more)])
    with pytest.warns(UserWarning, match=line) as warned:
        flown.to_plan(tmp_path / f"a.{suffix}", HOME)
    assert len(warned) == 1
    assert warned[0].filename == __file__


def test_what_no_plan_holds_is_refused(tmp_path: Path) -> None:
    """Nothing is written then."""
    path = tmp_path / "a.plan"
    with pytest.raises(ConfigError, match=r"'a' is relative to a take-off .* waypoint_type"):
        AeroNavigation(data=[Waypoint("a", 1, 2, 3)]).to_plan(path, HOME)
    with pytest.raises(ConfigError, match="holds waypoints alone"):
        AeroNavigation(data=[VelocityCommand(forward=1)]).to_plan(path, HOME)
    with pytest.raises(ConfigError, match=r"as \.plan or \.waypoints, not as 'a\.kml'"):
        AeroNavigation(data=[]).to_plan(tmp_path / "a.kml", HOME)
    assert not list(tmp_path.iterdir())
    path.write_text("mine")
    with pytest.raises(ConfigError, match="exists; remove it or"):
        AeroNavigation(data=[]).to_plan(path, HOME)
    assert path.read_text() == "mine"
    with pytest.raises(ConfigError, match=r"cannot write .*No such file"):
        AeroNavigation(data=[]).to_plan(tmp_path / "none" / "a.plan", HOME)
