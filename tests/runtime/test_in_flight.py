"""What an application does to a mission that flies: waypoints, refusals, and a second flight."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from analyses import Above, Ticker, Weave
from flying import FLAT, Flyer, hop, recorded, robot
from one_drone import drone_of, odometry_of, state_of

from aerodaas import AeroNavigation, AeroStreamData, Environment, Waypoint
from aerodaas.errors import GraphError
from aerodaas.messages.mission import MissionState

CAMERA = {"id": "cam", "type": "camera", "rate": 10, "settings": {"width": 64, "height": 36}}


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


def test_a_flight_takes_waypoints_and_no_addition_to_its_graph(flyer: Flyer) -> None:
    """Each refusal names the application's line and leaves graph and mission as they were."""
    content = {
        **FLAT,
        "robots": [robot(sensors=[*robot()["sensors"], CAMERA]), robot("other")],
        "recording": {"enabled": False},
    }
    above, streams = Above(0.0), list[AeroStreamData[AeroNavigation]]()

    def build(env: Environment) -> None:
        stay(env)
        above.analyse(odometry_of(env))
        streams.append(Weave().analyse(odometry_of(env)))

    with flyer.flying(build, content) as env:
        drone = drone_of(env)
        until(env, lambda: state_of(env) is MissionState.LOITERING)
        nodes, edges = set(env.graph.nodes), list(env.graph.navigation)
        ticker = Ticker().deploy(env.get_compute_resource_by_id("edge"))
        refused: list[tuple[str, Callable[[], object]]] = [
            ("analyse drone/odom_drone", lambda: Above(0.0).analyse(odometry_of(env))),
            ("instantiate it", ticker.instantiate),
            ("add drone/cam", drone.get_sensor_by_id("cam").get_data_stream),
            ("give it triggers", lambda: above.trigger(drone.end_mission)),
            ("navigate by drone/weave", lambda: drone.navigate(streams[0])),
            ("plug in a trajectory", lambda: env.set_trajectory_scheduler("nearest_neighbor")),
        ]
        for reason, call in refused:
            with pytest.raises(GraphError, match=rf"too late to {reason}.*\n.*test_in_flight"):
                call()
        with pytest.raises(GraphError, match="other cannot join a mission in flight"):
            env.get_robot_by_id("other").navigate(hop((1, 1)))
        assert (set(env.graph.nodes), env.graph.navigation) == (nodes, edges)
        drone.navigate(AeroNavigation(data=[Waypoint("urgent", 2.0, 2.0, 2.0, priority=0)]))
        until(env, lambda: "urgent" in env.launch().poll().robots["drone"].mission.visited)
        drone.end_mission()


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
        drone.navigate(AeroNavigation(data=[Waypoint("later", 0, 2, 2.0)]))
        drone.start_mission(wait=False)
        assert above.get_data(20.0) > 0.5
        drone.wait()
        second = env.launch()
        drone.start_mission()
        third = env.launch()
    visited = [recorded(run).robots["drone"].visited for run in (first, second, third)]
    assert visited == [("wp0",), ("later",), ("later",)]
    assert len({run.recording for run in (first, second, third)}) == 3
