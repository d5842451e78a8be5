"""A graph that grows on Ray: an analysis, navigation and a scheduler join a flight by the clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import pytest
from analyses import Above, Jitter, Weave
from flying import Flyer, hop, recorded

from aerodaas import Environment, TrajectoryScheduler, Waypoint
from aerodaas.messages.mission import MissionState
from aerodaas.schedulers.trajectory.base import PlanningContext

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]


class Backwards(TrajectoryScheduler):
    """Visits last what was given first."""

    isolated = False

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:  # noqa: ARG002
        """Turn the order round."""
        return sorted(pending, key=lambda waypoint: waypoint.id, reverse=True)


def test_a_graph_grows_in_flight(flyer: Flyer) -> None:
    """Its additions are flown, read, recorded and planned by, and an analysis ends the mission."""

    def build(env: Environment) -> None:
        env.get_robot_by_id("drone").navigate(hop((1, 0), hover=600))

    with flyer.flying(build, speed=5.0) as env:
        drone = env.get_robot_by_id("drone")
        odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()

        def until(holds: Callable[[], bool]) -> None:
            deadline = time.monotonic() + 60.0
            while not holds():
                assert time.monotonic() < deadline, "it never happened"
                assert not env.launch().poll().over, "the mission is over"
                time.sleep(0.02)

        def is_in(state: MissionState) -> bool:
            return env.launch().poll().robots["drone"].mission.state is state

        until(lambda: is_in(MissionState.LOITERING))
        assert Jitter().analyse(odometry).get_data(timeout=10.0) > 1.0
        env.set_trajectory_scheduler(Backwards(env))
        drone.navigate(Weave().analyse(odometry))
        env.trajectory_scheduler().clear_navigation()
        until(lambda: is_in(MissionState.FOLLOWING))
        Above(0.0, "again").trigger(drone.end_mission).analyse(odometry)
        run = env.launch()
    flight = recorded(run)
    assert flight.robots["drone"].bands[-1].state == "landed"
    assert {"drone/jitter", "drone/again", "drone/weave"} <= set(flight.latencies)
