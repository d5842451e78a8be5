"""Graphs that grow in flight: analyses, navigation and schedulers given to a mission that flies."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest
from analyses import Above, Jitter, Ticker, Weave
from flying import FLAT, Flyer, hop, recorded, robot
from one_drone import drone_of, odometry_of, state_of

from aerodaas import (
    AeroNavigation,
    Environment,
    NavigationType,
    SchedulingType,
    TrajectoryScheduler,
    Waypoint,
)
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.errors import GraphError, MissionError
from aerodaas.messages.mission import MissionState
from aerodaas.schedulers.trajectory.base import PlanningContext

CAMERA = {"id": "cam", "type": "camera", "rate": 10, "settings": {"width": 64, "height": 36}}


class Backwards(TrajectoryScheduler):
    """Visits last what was given first."""

    isolated = False

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:  # noqa: ARG002
        """Turn the order round."""
        return sorted(pending, key=lambda waypoint: waypoint.id, reverse=True)


class Unopened(Above):
    """Cannot be opened."""

    def open(self) -> None:
        """Raise."""
        raise MissionError("the model is not there")


def stay(env: Environment) -> None:
    """Hover at a place until the mission is ended."""
    drone_of(env).navigate(hop((1, 0), hover=600))


def until(env: Environment, condition: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait until `condition` holds; the mission must go on meanwhile."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it never happened"
        assert not env.launch().poll().over, "the mission is over"
        time.sleep(0.02)


def pending(env: Environment) -> list[str]:
    """What is still to be visited after the present waypoint, in planned order."""
    status = env.launch().poll().robots["drone"].mission
    return [waypoint.id for waypoint in status.pending]


@contextmanager
def watched_meanwhile(env: Environment) -> Iterator[None]:
    """Another thread looks at the flight all the time, and raises nothing."""
    run, done = env.launch(), threading.Event()

    def look() -> None:
        while not done.is_set():
            run.poll()
            run.reports()

    with ThreadPoolExecutor(1) as pool:
        looking = pool.submit(look)
        try:
            yield
        finally:
            done.set()
        looking.result()


def places(*waypoints: Waypoint, unordered: bool = False) -> AeroNavigation:
    """Waypoints as navigation."""
    order = SchedulingType.UNORDERED if unordered else SchedulingType.ORDERED
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, waypoints, order)


def test_an_analysis_joins_a_flight(flyer: Flyer) -> None:
    """It gets what is measured from then on, is recorded, triggers, and stops with the mission."""
    with flyer.flying(stay) as env:
        until(env, lambda: state_of(env) is MissionState.LOITERING)
        with watched_meanwhile(env):
            heights = Jitter().analyse(odometry_of(env))
        assert heights.get_data(timeout=10.0) > 1.0
        again = Above(0.0, "again").trigger(drone_of(env).end_mission).analyse(odometry_of(env))
        assert again.name == "drone/again"
        run = env.launch()
    flight = recorded(run)
    assert flight.robots["drone"].bands[-1].state == "landed"
    assert {"drone/jitter", "drone/again"} <= set(flight.latencies)


def test_navigation_joins_a_flight(flyer: Flyer) -> None:
    """Waypoints are flown, then a stream of commands, both given in flight."""
    with flyer.flying(stay) as env:
        until(env, lambda: state_of(env) is MissionState.LOITERING)
        drone_of(env).navigate(places(Waypoint("urgent", 2.0, 2.0, 2.0, priority=0)))
        until(env, lambda: "urgent" in env.launch().poll().robots["drone"].mission.visited)
        drone_of(env).navigate(Weave().analyse(odometry_of(env)))
        env.trajectory_scheduler().clear_navigation()
        until(env, lambda: state_of(env) is MissionState.FOLLOWING)
        drone_of(env).end_mission()
        run = env.launch()
    assert "following" in {band.state for band in recorded(run).robots["drone"].bands}


def test_a_scheduler_is_replaced_in_flight(flyer: Flyer) -> None:
    """What is queued is planned anew, beginning with what was queued before."""

    def build(env: Environment) -> None:
        waypoints = [Waypoint("a0", 0, 0, 2.0, hover_duration=600.0)]
        waypoints += [Waypoint(f"w{number}", number, 1.0, 2.0) for number in range(1, 4)]
        drone_of(env).navigate(places(*waypoints, unordered=True))

    with flyer.flying(build) as env:
        until(env, lambda: state_of(env) is MissionState.LOITERING)
        assert pending(env) == ["w1", "w2", "w3"]
        env.set_trajectory_scheduler(Backwards(env))
        until(env, lambda: pending(env) == ["w3", "w2", "w1"])
        drone_of(env).end_mission()


def test_a_camera_is_started_in_flight(flyer: Flyer) -> None:
    """One that is not recorded and that the application did not read when the mission began."""
    content = {
        **FLAT,
        "robots": [robot(sensors=[CAMERA])],
        "recording": {"enabled": False},
    }
    with flyer.flying(stay, content) as env:
        until(env, lambda: state_of(env) is MissionState.LOITERING)
        frame = drone_of(env).get_sensor_by_id("cam").poll(20.0)
        assert frame.image.shape == (36, 64, 3)
        drone_of(env).end_mission()


def test_an_external_source_joins_a_flight(flyer: Flyer) -> None:
    """It ticks with mission time from then on."""
    with flyer.flying(stay) as env:
        until(env, lambda: state_of(env) is MissionState.LOITERING)
        ticks = Ticker().deploy(env.get_compute_resource_by_id("edge")).instantiate()
        first, second = ticks.get_data(10.0), ticks.get_data(10.0)
        assert second != first
        drone_of(env).end_mission()


def test_what_cannot_join_is_refused_at_the_call(flyer: Flyer) -> None:
    """The graph stays as it was, and the mission flies on."""
    sensors = [*robot()["sensors"], CAMERA]
    robots = [robot(sensors=sensors), robot("other")]
    content = {**FLAT, "robots": robots, "schedulers": {"analytics": "fifo"}}
    with flyer.flying(stay, content) as env:
        until(env, lambda: state_of(env) is MissionState.LOITERING)
        nodes = set(env.graph.nodes)
        with (
            watched_meanwhile(env),
            pytest.raises(MissionError, match="the model is not there"),
        ):
            Unopened(0.0).analyse(odometry_of(env))
        with pytest.raises(GraphError, match="other cannot join a mission in flight"):
            env.get_robot_by_id("other").navigate(hop((1, 1)))
        camera = drone_of(env).get_sensor_by_id("cam").get_data_stream()
        model = SyntheticAnalytics("model", 1, 1).deploy(env.get_compute_resource_by_id("edge"))
        with pytest.raises(GraphError, match="drone/model would be a task of the analytics"):
            model.analyse(camera)
        with pytest.raises(GraphError, match="takes a stream of"):
            Above(0.0).analyse(camera)
        assert set(env.graph.nodes) == nodes
        above = Above(0.0)
        above.analyse(odometry_of(env))
        with pytest.raises(GraphError, match=r"drone/above runs already.*\n.*test_growth"):
            above.trigger(drone_of(env).end_mission)
        assert state_of(env) is MissionState.LOITERING
        drone_of(env).end_mission()


def test_one_environment_flies_twice(flyer: Flyer) -> None:
    """The second start flies what was given since, into a recording of its own."""
    path = flyer.write(FLAT)
    with flyer.options():
        env = Environment(path)
        drone = drone_of(env)
        above = Above(0.5).analyse(odometry_of(env))
        drone.navigate(hop((2, 0)))
        drone.start_mission(wait=False)
        drone.start_mission()
        first = env.launch()
        drone.navigate(places(Waypoint("later", 0, 2, 2.0)))
        drone.start_mission(wait=False)
        assert above.get_data(20.0) > 0.5
        drone.wait()
        second = env.launch()
        drone.start_mission()
        third = env.launch()
    visited = [recorded(run).robots["drone"].visited for run in (first, second, third)]
    assert visited == [("wp0",), ("later",), ("later",)]
    assert len({run.recording for run in (first, second, third)}) == 3
