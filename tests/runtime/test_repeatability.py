"""Simulated time: the same seed gives the same flight to the last bit, on a busy host too."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from analyses import Above, Jitter, Ticker, Weave, Wish
from flying import Flyer, hop, recorded

from aerodaas import Environment
from aerodaas.recording.report.flight import RecordedFlight

Build = Callable[[Environment], object]


def fly(
    flyer: Flyer, build: Build, content: dict[str, Any] | None = None, seed: int = 3
) -> RecordedFlight:
    """Fly once more, into a folder of its own."""
    count = len(list(flyer.folder.glob("flight-*")))
    run = flyer.fly(build, content, seed=seed, record=flyer.folder / f"flight-{count}")
    assert run.in_simulated_time
    return recorded(run)


def same(one: RecordedFlight, other: RecordedFlight) -> bool:
    """Whether two flights are equal to the last bit, for all robots."""
    return all(
        np.array_equal(robot._columns, other.robots[name]._columns)
        and robot.bands == other.robots[name].bands
        for name, robot in one.robots.items()
    )


def survey(env: Environment) -> None:
    """Waypoints, watched by an analysis of uneven pace."""
    drone = env.get_robot_by_id("drone")
    Jitter().analyse(drone.get_sensor_by_id("odom_drone").get_data_stream())
    drone.navigate(hop((4, 0), (4, 3), hover=0.5))


def test_the_same_seed_gives_the_same_trajectory(flyer: Flyer) -> None:
    """Two runs agree to the last bit; another seed's wind and noise give another flight."""
    first = fly(flyer, survey)
    assert first.robots["drone"].outcome.startswith("landed")
    assert first.robots["drone"].visited == ("wp0", "wp1")
    assert first.robots["drone"].time.size > 100
    assert same(first, fly(flyer, survey))
    assert not same(first, fly(flyer, survey, seed=4))


def test_an_analysis_that_steers_is_waited_for(flyer: Flyer) -> None:
    """With a slow and uneven analysis in the loop, two runs still agree to the last bit."""

    def weave(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
        drone.navigate(Weave().analyse(odometry))
        stop = Ticker().deploy(env.get_compute_resource_by_id("edge"))
        stop.trigger(drone.end_mission, when=lambda count: count > 40)
        stop.instantiate()

    first = fly(flyer, weave)
    flown = first.robots["drone"].position
    assert np.ptp(flown[:, 0]) > 1.0
    assert np.ptp(flown[:, 1]) > 1.0
    assert same(first, fly(flyer, weave))


@pytest.mark.slow
def test_wakes_and_external_sources_are_waited_for(flyer: Flyer) -> None:
    """An analysis woken by another one, and navigation from outside, repeat to the last bit."""

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        edge = env.get_compute_resource_by_id("edge")
        odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
        end = Above(1.2, "end")
        end.analyse(odometry)
        end.trigger(drone.end_mission)
        ticker = Ticker().deploy(edge)
        ticker.trigger(end, when=lambda count: count >= 30)
        ticker.instantiate()
        drone.navigate(hop((6, 0), (0, 0), (6, 0), (0, 0)))
        env.trajectory_scheduler().add_navigation(Wish().deploy(edge).instantiate())

    first = fly(flyer, build)
    assert first.robots["drone"].outcome == "landed: an analysis asked to land"
    landing = next(band for band in first.robots["drone"].bands if band.state == "landing")
    # The thirtieth tick, at 29 / 4 s, wakes the analysis; the next odometry ends the mission.
    assert landing.start == pytest.approx(7.35, abs=0.06)
    assert "wish" in first.robots["drone"].plan
    for _ in range(2):
        assert same(first, fly(flyer, build))
