"""The paper's mission patterns; (d), and (e) by what a camera sees, are `test_flown_listings`."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, hop, recorded, robot
from scripted import Drift, RemoteUser, free_port

from aerodaas import (
    AeroNavigation,
    Environment,
    MonitoringAnalytics,
    NavigationType,
    NearestNeighborScheduler,
    SchedulingType,
    VelocityCommand,
)
from aerodaas.analytics import RemoteAnalytics
from aerodaas.environment.run import Run
from aerodaas.recording.report.flight import RobotFlight

pytestmark = pytest.mark.wall_clock


def flown(run: Run) -> RobotFlight:
    """The drone's part of the recording."""
    return recorded(run).robots["drone"]


def states(robot_flight: RobotFlight) -> list[str]:
    """The states that the mission went through."""
    return [state for state, _ in groupby(band.state for band in robot_flight.bands)]


def environment(**remote: Any) -> dict[str, Any]:  # noqa: ANN401
    """A drone that is slow enough for a remote user to keep up with."""
    limits = {"cruise_speed": 2.0, "takeoff_height": 2.0, "silence_return": 5.0}
    sensors = [
        {"id": "odom", "type": "odometry", "rate": 20},
        {"id": "stat_stream", "type": "status", "rate": 5},
    ]
    return {**FLAT, "robots": [robot(limits=limits, sensors=sensors)], "remote": remote}


def test_a_static_waypoints(flyer: Flyer) -> None:
    """(a) A plan known beforehand is flown as planned; the state sensor agrees with odometry."""

    def survey(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        watch = MonitoringAnalytics(["battery", "height", "state"])
        watch.analyse(drone.get_sensor_by_id("odom").get_data_stream())
        watch.analyse(drone.get_sensor_by_id("stat_stream").get_data_stream())
        drone.navigate(hop((8, 0), (8, 8), (0, 8), hover=1.0))

    run = flyer.fly(survey, environment())
    mission = flown(run)
    assert mission.visited == ("wp0", "wp1", "wp2")
    side = ["enroute", "loitering"]
    assert states(mission)[-9:] == [*side * 3, "returning", "landing", "landed"]
    assert run.state is not None
    assert "disagree" not in str([alert.text for alert in run.state.alerts])
    # Three sides of the square and its diagonal home, take-off and landing.
    assert mission.distance == pytest.approx(24 + 8 + 4, abs=3.0)


def test_b_dynamic_waypoints_from_a_remote_user(flyer: Flyer) -> None:
    """(b) A remote user adds waypoints in flight, pauses and resumes; bad ones are refused."""
    port = free_port()

    def survey(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        edge = env.get_compute_resource_by_id("edge")
        scheduler = NearestNeighborScheduler(env)
        env.set_trajectory_scheduler(scheduler)
        odometry = drone.get_sensor_by_id("odom").get_data_stream()
        remote = RemoteAnalytics(env.env_data).deploy(edge).analyse(odometry)
        scheduler.add_navigation(
            AeroNavigation(NavigationType.ANALYTICS_DRIVEN, remote, SchedulingType.UNORDERED)
        )
        first = hop((20, 0), (20, 60), (0, 60))
        drone.navigate(
            AeroNavigation(first.navigation_type, first.waypoints, SchedulingType.UNORDERED)
        )

    def add(user: RemoteUser) -> None:
        user.until(lambda status: "wp0" in status.mission.visited)
        user.client.command("pause")
        near = {"id": "near", "x": 19, "y": 40, "z": 2}
        far = {"id": "far", "x": 0, "y": 100, "z": 2}
        outside = {"id": "outside", "x": 0, "y": 5000, "z": 2}
        answer = user.client.add_waypoints([far, near, outside], ordered=False)
        assert list(answer["refused"]) == ["outside"]
        assert user.client.status().mission.state == "paused"
        user.client.command("resume")

    with RemoteUser(port, add):
        mission = flown(flyer.fly(survey, environment(port=port)))
    assert mission.visited == ("wp0", "near", "wp1", "wp2", "far")
    assert set(mission.given_up) == {"outside"}
    assert "paused" in states(mission)
    assert states(mission)[-1] == "landed"


def test_c_sensor_driven_from_nothing(flyer: Flyer) -> None:
    """(c) No waypoints at all: analytics flies the drone, and it comes home when that ends."""

    def drift(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        odometry = drone.get_sensor_by_id("odom").get_data_stream()
        command = VelocityCommand(forward=2.0, yaw_rate=0.2)
        drone.navigate(
            AeroNavigation(
                NavigationType.ANALYTICS_DRIVEN, Drift(5.0, 15.0, command).analyse(odometry)
            )
        )

    mission = flown(flyer.fly(drift, environment()))
    assert mission.plan == {}
    assert states(mission)[-6:] == [
        "holding",
        "following",
        "holding",
        "returning",
        "landing",
        "landed",
    ]
    assert "navigation has been silent" in mission.outcome
    assert np.linalg.norm(mission.position[:, :2], axis=1).max() > 8.0
    assert np.linalg.norm(mission.position[-1]) < 1.0


def test_e_abort_by_an_event_alone(flyer: Flyer) -> None:
    """(e) `clear_navigation(on=…)` of any stream empties the queue; nothing follows: home."""

    def search(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        odometry = drone.get_sensor_by_id("odom").get_data_stream()
        hazard = Drift(8.0, 9.0, VelocityCommand()).analyse(odometry)
        drone.navigate(hop((40, 0)))
        env.trajectory_scheduler().clear_navigation(on=hazard)

    mission = flown(flyer.fly(search, environment()))
    assert mission.visited == ()
    assert mission.position[:, 0].max() < 20.0
    assert states(mission)[-1] == "landed"
