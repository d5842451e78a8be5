"""Grippers, servos and relays in plans become moves of the waypoint before, and back."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from keywords import keywords
from plan_files import item, plan

from aerodaas import AeroNavigation, Waypoint
from aerodaas.config.sections.actuators import (
    ActuatorConfig,
    GripperConfig,
    ParachuteConfig,
    RelayConfig,
    ServoConfig,
)
from aerodaas.errors import ConfigError
from aerodaas.extensions.plans.navigation import flown_plan
from aerodaas.extensions.plans.plan import Plan
from aerodaas.extensions.plans.waypoints_in import waypoints_of
from aerodaas.extensions.plans.writing import planned
from aerodaas.geometry.frames import GeodeticOrigin

HOME = GeodeticOrigin(47.0, 8.0, 535.0)
CARRIED: list[ActuatorConfig] = [
    GripperConfig(id="hook", type="gripper", instance=2),
    RelayConfig(id="pump", type="relay", instance=3),
    ServoConfig(id="hatch", type="servo", channel=9, positions={"open": 1900, "closed": 1100}),
    ParachuteConfig(id="chute", type="parachute", may_release=True),
]
HERE = item(16, [0, 0, 0, None, 47.0009, 8.0, 20])


def test_items_become_moves_of_the_waypoint_before(tmp_path: Path) -> None:
    """By instance and channel; one that is moved twice gets a waypoint in the same place."""
    path = plan(
        tmp_path / "drop.plan",
        HERE,
        item(183, [9, 1900, 0, 0, 0, 0, 0], 2),
        item(211, [2, 0, 0, 0, 0, 0, 0], 2),
        item(181, [3, 1, 0, 0, 0, 0, 0], 2),
        item(181, [3, 0, 0, 0, 0, 0, 0], 2),
        item(16, [0, 0, 0, None, 47.0019, 8.0, 20]),
    )
    waypoints, notices = flown_plan(path, actuators=CARRIED)
    assert [(one.id, keywords(one).actuate) for one in waypoints] == [
        ("item1", {"hatch": "open", "hook": "release", "pump": "on"}),
        ("item5", {"pump": "off"}),
        ("item6", {}),
    ]
    assert waypoints[0].x == waypoints[1].x
    assert not notices


@pytest.mark.parametrize(
    ("number", "values", "said"),
    [
        (211, [1, 0], "no actuator of the environment has this number; nothing is moved"),
        (183, [9, 1500], "the actuator hatch has no position for 1500.0"),
        (181, [3, -1], "the actuator pump has no position for -1.0"),
        (208, [2, 0], "no payload is moved"),
    ],
)
def test_what_moves_nothing_is_said(
    tmp_path: Path, number: int, values: list[float], said: str
) -> None:
    """An unknown number, another pulse, a toggle; and a plan fires no parachute."""
    path = plan(tmp_path / "drop.plan", HERE, item(number, [*values, 0, 0, 0, 0, 0], 2))
    waypoints, notices = flown_plan(path, actuators=CARRIED)
    assert keywords(waypoints[0]).actuate == {}
    assert [notice.why for notice in notices] == [said]


def test_without_actuators_it_is_said_as_ever(tmp_path: Path) -> None:
    """And before the first waypoint nothing is moved."""
    path = plan(tmp_path / "drop.plan", HERE, item(211, [2, 0, 0, 0, 0, 0, 0], 2))
    assert [notice.why for notice in flown_plan(path)[1]] == ["no payload is moved"]
    path = plan(tmp_path / "early.plan", item(211, [2, 0, 0, 0, 0, 0, 0], 2), HERE)
    (notice,) = flown_plan(path, actuators=CARRIED)[1]
    assert notice.why == "nothing is moved before the first waypoint"


moves = st.dictionaries(
    st.sampled_from(["hook", "pump", "hatch"]), st.integers(0, 1), max_size=3
).map(
    lambda chosen: {
        one.id: tuple(one.positions)[chosen[one.id]] for one in CARRIED if one.id in chosen
    }
)


@given(st.lists(moves, min_size=1, max_size=4))
def test_what_is_written_is_read_again(asked: list[dict[str, str]]) -> None:
    """Every position of every actuator."""
    flown = [
        Waypoint(f"w{index}", 10.0 * index, 0, 20, waypoint_type="local", actuate=one)
        for index, one in enumerate(asked)
    ]
    made: Plan = planned(flown, HOME, None, CARRIED)[0]
    read, _ = waypoints_of(made, None, None, CARRIED)
    assert [keywords(one).actuate for one in read] == asked


def test_what_a_plan_cannot_hold_is_refused(tmp_path: Path) -> None:
    """The actuators have to be given."""
    stop = Waypoint("drop", 0, 0, 20, waypoint_type="local", actuate={"hook": "release"})
    navigation = AeroNavigation(data=[stop])
    with pytest.raises(ConfigError, match="hook: release cannot be written: give"):
        navigation.to_plan(tmp_path / "drop.plan", HOME)
    navigation.to_plan(tmp_path / "drop.plan", HOME, actuators=CARRIED)
    read, _ = flown_plan(tmp_path / "drop.plan", actuators=CARRIED)
    assert keywords(read[0]).actuate == {"hook": "release"}
