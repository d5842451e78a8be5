"""Pictures, gimbals and places to look at: read from plans, and written so that they come back."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from keywords import keywords
from plan_files import item, lines, plan, survey, waypoint

from aerodaas import AeroNavigation, Waypoint
from aerodaas.config.sections.actuators import GripperConfig
from aerodaas.extensions.plans.navigation import flown_plan, read_plan
from aerodaas.geometry.frames import GeodeticOrigin

HOME = GeodeticOrigin(47.0, 8.0, 535.0)
DOWN = -math.pi / 2


def do(command: int, *values: Any, x: Any = 0, y: Any = 0, z: Any = 0, frame: int = 2) -> Any:  # noqa: ANN401
    """An item that does something."""
    return item(command, [*values, *[0] * (4 - len(values)), x, y, z], frame)


def read(path: Path, *items: Any, **more: Any) -> tuple[list[Waypoint], list[str]]:  # noqa: ANN401
    """The waypoints of a plan of these items, and what is left out."""
    waypoints, notices = flown_plan(plan(path / "a.plan", *items, **more))
    return waypoints, [str(notice) for notice in notices]


def test_a_survey_of_qgroundcontrol_takes_its_pictures(tmp_path: Path) -> None:
    """Gimbal down before the first line, triggers on the lines and not between them."""
    transects = survey(
        waypoint(0.001),
        do(206, 25, 0, 1),
        waypoint(0.002),
        do(206, 0, 0, 1),
        waypoint(0.0025),
        do(206, 25, 0, 1),
        waypoint(0.003),
        do(206, 0, 0, 1),
    )
    waypoints, notices = read(tmp_path, do(205, -90, 0, 0, z=2), transects, item(20, [0] * 7, 2))
    assert notices == []
    assert [keywords(one).trigger_distance for one in waypoints] == [None, 25.0, None, 25.0]
    assert [keywords(one).gimbal_pitch for one in waypoints] == [
        pytest.approx(DOWN),
        None,
        None,
        None,
    ]


def test_pictures_of_hover_and_capture_are_the_waypoints_before(tmp_path: Path) -> None:
    """Each, with the gimbal turned before it; ArduPilot's own command, too."""
    waypoints, notices = read(
        tmp_path,
        waypoint(0.001),
        do(1000, -45, 30, None, None, x=12),
        do(2000, 0, 0, 1),
        waypoint(0.002),
        do(203, x=1),
        waypoint(0.003),
    )
    assert notices == []
    assert [keywords(one).photo for one in waypoints] == [True, True, False]
    assert keywords(waypoints[0]).gimbal_pitch == pytest.approx(math.radians(-45))
    assert keywords(waypoints[0]).gimbal_yaw == pytest.approx(math.radians(-30))
    assert keywords(waypoints[1]).gimbal_pitch is None


@pytest.mark.parametrize(
    "begin", [do(2000, 0, 3.0, 0), do(214, 3000, 0)], ids=["IMAGE_START_CAPTURE", "INTERVAL"]
)
def test_pictures_by_time_go_on_until_they_are_stopped(tmp_path: Path, begin: Any) -> None:  # noqa: ANN401
    """From the waypoint after the command to the one before the stop."""
    waypoints, notices = read(
        tmp_path,
        *(waypoint(0.001), begin, waypoint(0.002), waypoint(0.003), do(2001), waypoint(0.004)),
    )
    assert notices == []
    assert [keywords(one).trigger_interval for one in waypoints] == [None, 3.0, 3.0, None]


def test_a_region_of_interest_is_looked_at_until_it_ends(tmp_path: Path) -> None:
    """From the next waypoint on; its end turns the gimbal ahead."""
    waypoints, notices = read(
        tmp_path,
        waypoint(0.001),
        do(195, x=47.0015, y=8.001, z=3, frame=3),
        waypoint(0.002),
        waypoint(0.003),
        do(197),
        waypoint(0.004),
    )
    assert notices == []
    assert [keywords(one).look_at for one in waypoints] == [None, (47.0015, 8.001, 3.0), None, None]
    assert [keywords(one).gimbal_pitch is not None for one in waypoints] == [
        False,
        False,
        False,
        True,
    ]
    old = read(tmp_path, do(201, 3, x=47.1, y=8.1, z=4, frame=3), waypoint(0.001))[0]
    assert keywords(old[0]).look_at == (47.1, 8.1, 4.0)


@pytest.mark.parametrize(
    ("items", "why"),
    [
        ([do(2000, 0, 0, 1), waypoint(0.001)], "no waypoint comes before it"),
        ([waypoint(0.001), do(2000, 0, 0, 1), do(203, x=1)], "one picture is taken at a waypoint"),
        ([waypoint(0.001), do(2000, 0, 2, 7)], "single pictures are taken, and those by time"),
        ([waypoint(0.001), do(203, x=0)], "no picture is taken by it"),
        ([waypoint(0.001), do(206, 5, 0, 1)], "no waypoint comes after it"),
        ([waypoint(0.001), do(205, -90, z=2)], "no waypoint comes after it"),
        ([do(206, 0.05), waypoint(0.001)], "at least 0.1 m or s apart"),
        ([do(214, -1), waypoint(0.001)], "an interval of 0 changes nothing"),
        ([do(205, -90, z=3), waypoint(0.001)], "not mode 3"),
        ([do(1000, None, None, 5, 5), waypoint(0.001)], "angles are done, not rates"),
        ([do(1000, -90, 90, x=16), waypoint(0.001)], "not from north"),
        ([do(195, x=470, y=8, frame=3), waypoint(0.001)], "no latitude"),
        ([do(195, x=47, y=8, frame=9), waypoint(0.001)], "frame 9 is not known"),
        ([do(195, x=47, y=8, frame=10), waypoint(0.001)], "not counted from what the waypoint"),
        ([do(201, 1), waypoint(0.001)], "no gimbal is moved"),
        ([do(197), waypoint(0.001)], "no gimbal is moved"),
        ([do(531, 2, 40), waypoint(0.001)], "the lens stays as it is"),
        ([do(2500), waypoint(0.001)], "no waypoint comes before it"),
        ([waypoint(0.001), do(2501, 2)], "is recorded whole, not its stream 2"),
    ],
)
def test_what_still_is_not_done_is_said(tmp_path: Path, items: list[Any], why: str) -> None:
    """With item and reason; the plan is flown."""
    waypoints, notices = read(tmp_path, *items)
    assert len(waypoints) == 1
    assert len(notices) == 1
    assert why in notices[0]


def test_mission_planner_writes_no_mount_mode(tmp_path: Path) -> None:
    """ArduPilot does not look at it; PX4's 0 is to fold the gimbal away."""
    path = lines(tmp_path / "a.waypoints", "0 205 -60 0 0 0 0 0 0", "3 16 0 0 0 0 47.001 8 20")
    ((one,), notices) = flown_plan(path)
    assert keywords(one).gimbal_pitch == pytest.approx(math.radians(-60))
    assert notices == []
    assert "not mode 0" in read(tmp_path, do(205, -60), waypoint(0.001))[1][0]


angle = st.floats(-3.14, 3.14)
metres = st.floats(-2000.0, 2000.0)
aims = st.one_of(
    st.just({}),
    st.builds(lambda pitch, yaw: {"gimbal_pitch": pitch, "gimbal_yaw": yaw}, angle, angle),
    st.builds(lambda x, y, z: {"look_at": (x, y, z)}, metres, metres, st.floats(-50, 300)),
)
triggers = st.one_of(
    st.just({}),
    st.builds(lambda value: {"trigger_distance": value}, st.sampled_from([4.0, 7.5, 120.0])),
    st.builds(lambda value: {"trigger_interval": value}, st.sampled_from([1.0, 2.5, 60.0])),
)


def test_a_video_begins_and_ends_at_the_waypoint_before(tmp_path: Path) -> None:
    """With the view that was set before it; what follows is the next waypoint's."""
    waypoints, notices = read(
        tmp_path,
        waypoint(0.001),
        do(1000, -45, 30, None, None, x=12),
        do(2000, 0, 0, 1),
        do(2500),
        waypoint(0.002),
        do(1000, -90, 0, None, None, x=12),
        do(2501),
        waypoint(0.003),
    )
    assert notices == []
    assert [keywords(one).video for one in waypoints] == [True, False, None]
    assert [keywords(one).photo for one in waypoints] == [True, False, False]
    assert [keywords(one).gimbal_pitch is not None for one in waypoints] == [True, False, True]
    both = read(tmp_path, waypoint(0.001), do(2500), do(2501))[0]
    assert [keywords(one).video for one in both] == [True, False]
    begun = read(tmp_path, waypoint(0.001), do(1000, -45, 30, None, None, x=12), do(2500))[0]
    assert keywords(begun[0]).gimbal_pitch == pytest.approx(math.radians(-45))


def test_a_video_keeps_its_place_among_stay_picture_and_actuators(tmp_path: Path) -> None:
    """In the plan's order, where need be at a waypoint of its own in the same place."""
    path = plan(
        tmp_path / "a.plan",
        *(waypoint(0.001, hover=5.0), do(2500), item(93, [7, -1, -1, -1, 0, 0, 0], 2), do(2501)),
        *(do(2000, 0, 0, 1), waypoint(0.002), do(211, 1, 0), do(2500)),
    )
    hook = GripperConfig(id="hook", type="gripper")
    waypoints, notices = flown_plan(path, actuators=[hook])
    assert notices == []
    assert [keywords(one).video for one in waypoints] == [None, True, False, None, None, True]
    assert [one.hover_duration for one in waypoints] == [5.0, 7.0, 0.0, 0.0, 0.0, 0.0]
    assert [keywords(one).photo for one in waypoints] == [False, False, False, True, False, False]
    assert [bool(keywords(one).actuate) for one in waypoints] == [False] * 4 + [True, False]
    assert len({one.id for one in waypoints}) == 6
    assert len({one.x for one in waypoints}) == 2


videos = st.builds(
    lambda video, hover: {"video": video, "hover_duration": hover},
    st.sampled_from([None, True, False]),
    st.sampled_from([0.0, 5.0]),
)


@pytest.mark.parametrize("suffix", ["plan", "waypoints"])
@given(legs=st.lists(st.tuples(metres, metres, st.booleans(), aims, triggers, videos), max_size=7))
def test_pictures_come_back(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, legs: list[tuple[Any, ...]]
) -> None:
    """Each waypoint's own, whatever stood at the one before."""
    asked = [
        Waypoint(f"w{n}", x, y, 20.0, waypoint_type="local", photo=photo, **(a | b | c))
        for n, (x, y, photo, a, b, c) in enumerate(legs)
    ]
    path = tmp_path_factory.mktemp("out") / f"a.{suffix}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        AeroNavigation(data=asked).to_plan(path, HOME)
    waypoints, notices = flown_plan(path)
    assert [notice.command for notice in notices] == ["NAV_TAKEOFF"]
    came = [one.resolve(np.zeros(3), HOME) for one in waypoints]
    assert [keywords(one).photo for one in came] == [keywords(one).photo for one in asked]
    assert [keywords(one).video for one in came] == [keywords(one).video for one in asked]
    assert [one.hover_duration for one in came] == [one.hover_duration for one in asked]
    for ours, theirs in zip(asked, came, strict=True):
        assert keywords(theirs).trigger_distance == pytest.approx(keywords(ours).trigger_distance)
        assert keywords(theirs).trigger_interval == pytest.approx(keywords(ours).trigger_interval)
        assert keywords(theirs).gimbal_pitch == pytest.approx(keywords(ours).gimbal_pitch, abs=1e-9)
        assert keywords(theirs).gimbal_yaw == pytest.approx(keywords(ours).gimbal_yaw, abs=1e-9)
        assert keywords(theirs).look_at == pytest.approx(keywords(ours).look_at, abs=0.01)


def test_what_a_ground_station_finds_of_pictures(tmp_path: Path) -> None:
    """Triggers where they change, the gimbal before its waypoint, single pictures behind theirs."""
    flown = [
        Waypoint("a", 0, 9, 12, waypoint_type="local", gimbal_pitch=DOWN),
        Waypoint("b", 50, 9, 12, waypoint_type="local", trigger_distance=5.0),
        Waypoint("c", 60, 9, 12, waypoint_type="local", trigger_distance=5.0, photo=True),
        Waypoint("d", 60, 30, 12, waypoint_type="local", trigger_interval=2.0),
        Waypoint("e", 0, 30, 12, waypoint_type="local", look_at=(10.0, 10.0, 1.0)),
    ]
    path = tmp_path / "a.plan"
    AeroNavigation(data=flown).to_plan(path, HOME)
    items = read_plan(path).items
    commands = [one.command for one in items]
    assert commands == [
        22,
        205,
        16,
        206,
        16,
        16,
        2000,
        206,
        2000,
        16,
        2001,
        195,
        16,
        20,
    ]
    assert [one.number for one in items] == list(range(1, 15))
    assert items[1].values == (-90.0, 0.0, 0.0, 0.0)
    assert items[1].z == 2.0
    assert items[3].values[:3] == (5.0, 0.0, 1.0)
    assert items[6].values[:3] == (0.0, 0.0, 1.0)
    assert items[7].values[0] == 0.0
    assert items[8].values[:3] == (0.0, 2.0, 0.0)
    assert items[11].frame == 3
