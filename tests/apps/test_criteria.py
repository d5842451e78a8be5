"""Criteria fail where a flight is bad: each is shown a good one and one that misses it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerodaas.config.model import GeofenceConfig, LimitsConfig, RobotConfig
from aerodaas.recording.report.flight import Band, RecordedFlight, RobotFlight
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from missions.criteria import (
    alerted_of,
    climbed,
    distance_held,
    fence_kept,
    followed,
    found_between,
    hit_nothing,
    landed,
    landed_upon,
    reached,
    states,
)
from missions.evidence import Evidence

WORLD = World(
    Scenario.model_validate(
        {
            "name": "test",
            "entities": [
                {
                    "kind": "person",
                    "id": "vip",
                    "motion": {"points": [(2, 0), (60, 0)], "speed": 0.5, "variation": 0.0},
                    "gestures": [{"kind": "hand_raised", "start": 58}],
                },
                {"kind": "building", "id": "house", "at": (15, 12), "yaw": 0, "size": (6, 6, 4)},
            ],
        }
    )
)


def flight(offset: float = 0.0, *, height: float = 1.5) -> Evidence:
    """Two metres behind a person who walks east, from 10 s to 60 s; `offset` aside to the north."""
    time = np.arange(0.0, 66.0, 0.1)
    east = np.clip(0.5 * (time - 0.0), 0.0, 30.0)
    up = np.interp(time, [0, 3, 60, 65], [0, height, height, 0])
    position = np.stack([east, np.full_like(time, offset), up], -1)
    velocity = np.gradient(position, time, axis=0)
    robot = RobotFlight(
        bands=[
            Band("taking_off", 0.0, 3.0),
            Band("enroute", 3.0, 6.0, "flying to wp1"),
            Band("loitering", 6.0, 8.0, "at wp1"),
            Band("enroute", 8.0, 10.0, "flying to wp2"),
            Band("following", 10.0, 60.0),
            Band("landing", 60.0, 65.0),
            Band("landed", 65.0, 66.0),
        ],
        plan={"wp1": (3.0, 0.0, 1.5), "wp2": (60.0, 30.0, 1.5)},
        visited=("wp1",),
    )
    fence = GeofenceConfig(polygon=[(-5, -5), (40, -5), (40, 5), (-5, 5)], ceiling=10)
    config = RobotConfig(id="drone", limits=LimitsConfig(geofence=fence))
    log = RecordedFlight(alerts=[(60.0, "hand_raised", "The person raises a hand.")])
    return Evidence(log, robot, config, WORLD, time, position, velocity)


GOOD = {
    "states": states("taking_off (enroute loitering){1,2} enroute? following landing landed"),
    "reached": reached("wp1", never=("wp2",)),
    "held": distance_held("vip", 2.0, within=0.3, share=0.95, nearest=1.0),
    "followed": followed("vip", 20, reach=4.0),
    "between": found_between("wp1", "wp2"),
    "alerted": alerted_of("vip", "hand_raised", "hand", within=5.0),
    "upon": landed_upon("vip", "hand_raised", within=5.0),
    "landed": landed(),
    "hit": hit_nothing,
    "fence": fence_kept,
}


@pytest.mark.parametrize("name", list(GOOD))
def test_a_good_flight_meets_it(name: str) -> None:
    """The flight that each criterion is for."""
    found = GOOD[name](flight())
    assert found.holds, found


@pytest.mark.parametrize("name", ["reached", "held", "followed", "fence"])
def test_a_flight_beside_the_way_misses_it(name: str) -> None:
    """Six metres to the north: too far from the waypoint and the person, out of the fence."""
    found = GOOD[name](flight(offset=6.0))
    assert not found.holds, found


def test_flying_into_a_house_is_seen() -> None:
    """Through its walls, not over its roof, not beside it."""
    assert not hit_nothing(flight(offset=12.0)).holds
    assert hit_nothing(flight(offset=12.0, height=6.0)).holds
    assert hit_nothing(flight(offset=30.0)).holds


def test_an_order_of_states_is_exact() -> None:
    """A state too many, one too few, or one whose name is longer does not match."""
    evidence = flight()
    for pattern in ("taking_off following landing landed", "taking_off enroute loitering .*ing"):
        assert not states(pattern)(evidence).holds
    extra = replace(evidence.robot, bands=[*evidence.robot.bands, Band("aborted", 66, 67)])
    assert not GOOD["states"](replace(evidence, robot=extra)).holds


def test_a_moments_wait_for_a_plan_is_no_state() -> None:
    """As long as it is one: a drone that hangs about is seen."""
    evidence = flight()
    for wait, holds in ((0.1, True), (2.0, False)):
        planning = Band("holding", 8.0 - wait, 8.0, "waiting for a plan")
        bands = [*evidence.robot.bands[:3], planning, *evidence.robot.bands[3:]]
        robot = replace(evidence.robot, bands=bands)
        assert GOOD["states"](replace(evidence, robot=robot)).holds is holds


def test_a_resumed_plan_is_seen() -> None:
    """A waypoint that was to be dropped and was visited."""
    evidence = flight()
    robot = replace(evidence.robot, visited=("wp1", "wp2"))
    assert not GOOD["reached"](replace(evidence, robot=robot)).holds


def test_alarms_must_neither_fail_nor_be_false() -> None:
    """None, one too late, and one before there was a reason."""
    evidence = flight()
    for alerts in (
        [],
        [(64.0, "hand_raised", "")],
        [(20.0, "hand_raised", ""), (60.0, "hand", "")],
    ):
        log = RecordedFlight(alerts=alerts)
        assert not GOOD["alerted"](replace(evidence, flight=log)).holds


def test_a_crash_is_no_landing() -> None:
    """Down too fast, or not down at all."""
    evidence = flight()
    fast = evidence.velocity.copy()
    fast[evidence.time > 64.0, 2] = -2.0
    assert not landed()(replace(evidence, velocity=fast)).holds
    high = evidence.position.copy()
    high[-1, 2] = 1.0
    assert not landed()(replace(evidence, position=high)).holds
    assert not landed(at_home=5.0)(evidence).holds


def test_a_climb_needs_base_and_top() -> None:
    """Neither was reached beside the person."""
    assert not climbed("vip", 2.0, 30.0, clearance=1.0)(flight()).holds
    assert not climbed("vip", 1.0, 1.4, clearance=1.0)(flight()).holds
    assert climbed("vip", 2.0, 1.4, clearance=1.0)(flight()).holds
