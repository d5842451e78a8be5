"""From a graph to nodes and actors: placement, and what is observed in simulated time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from analyses import Above, Broken, Jitter, ProcessId, Ticker, Weave
from flying import FLAT, Flyer, hop, robot

from aerodaas import Environment
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.dataflow.graph import AeroStreamData
from aerodaas.errors import GraphError, SchedulerError
from aerodaas.runtime.placement import Placement
from aerodaas.runtime.plan import FlightPlan, make_plan
from aerodaas.runtime.session import Session
from aerodaas.schedulers.analytics.registry import load_scheduler

CAMERA = {"id": "cam", "type": "camera", "rate": 10, "settings": {"width": 64, "height": 36}}
ODOMETRY = {"id": "odom", "type": "odometry", "rate": 10}
CONTENT = {
    **FLAT,
    "robots": [robot(sensors=[ODOMETRY, CAMERA])],
    "compute": [
        {"id": "edge", "kind": "edge"},
        {"id": "cloud", "kind": "cloud"},
        {"id": "near", "kind": "edge", "node": "10.0.0.7"},
    ],
}


@pytest.fixture
def environment(tmp_path: Path) -> Environment:
    """An environment with one drone, a camera and three places to compute at."""
    return Environment(Flyer(tmp_path).write(CONTENT))


def odometry(env: Environment) -> AeroStreamData[Any]:
    """The drone's odometry."""
    return env.get_robot_by_id("drone").get_sensor_by_id("odom").get_data_stream()


def camera(env: Environment) -> AeroStreamData[Any]:
    """The drone's camera."""
    return env.get_robot_by_id("drone").get_sensor_by_id("cam").get_data_stream()


def plan(env: Environment, speed: float | None = None) -> FlightPlan:
    """The plan of what was built so far; None is simulated time."""
    scheduler = env.trajectory_scheduler()
    return make_plan(Session(env.config, speed), env.graph, env.compute(), scheduler)


def test_nothing_flies_without_navigation(environment: Environment) -> None:
    """The remedy is named."""
    with pytest.raises(GraphError, match=r"drone\.navigate"):
        plan(environment)


@pytest.mark.parametrize(
    ("compute", "costs"),
    [
        (CONTENT["compute"], {"edge_cost": 3, "cloud_cost": 2}),
        ([{"id": "edge"}], {"edge_cost": 3}),  # the cloud would pay, but there is none
    ],
)
def test_what_costs_more_than_its_worth_everywhere_is_refused(
    tmp_path: Path, compute: list[dict[str, str]], costs: dict[str, float]
) -> None:
    """Before anything flies, by the analysis' name."""
    tasks = {"model": {"benefit": 2, **costs}}
    content = {**CONTENT, "compute": compute, "schedulers": {"tasks": tasks}}
    env = Environment(Flyer(tmp_path).write(content))
    model = SyntheticAnalytics("model", 10, 20).deploy(env.get_compute_resource_by_id("edge"))
    model.analyse(camera(env))
    env.get_robot_by_id("drone").navigate(hop((1, 0)))
    session, scheduler = Session(env.config, None), env.trajectory_scheduler()
    with pytest.raises(SchedulerError, match="'drone/model' costs at least its benefit of 2"):
        make_plan(session, env.graph, env.compute(), scheduler, load_scheduler("dems"))


def test_light_analyses_share_an_actor_by_place(environment: Environment) -> None:
    """An isolated analysis has an actor of its own; the others share one at each place."""
    env = environment
    env.get_robot_by_id("drone").navigate(hop((1, 0)))
    Jitter().analyse(odometry(env))
    Above(1, "a").deploy(env.get_compute_resource_by_id("edge")).analyse(odometry(env))
    Above(1, "b").deploy(env.get_compute_resource_by_id("cloud")).analyse(odometry(env))
    Above(1, "c").deploy(env.get_compute_resource_by_id("near")).analyse(odometry(env))
    ProcessId("").deploy(env.get_compute_resource_by_id("cloud")).analyse(odometry(env))
    actors = {actor.name: actor for actor in plan(env).actors}
    streams = {
        name: [spec.stream for spec in (*actor.cameras, *actor.analyses)]
        for name, actor in actors.items()
    }
    assert streams == {
        "analytics/drone/process_id": ["drone/process_id"],
        "edge": ["drone/cam", "drone/jitter", "drone/a"],
        "cloud": ["drone/b"],
        "10.0.0.7": ["drone/c"],
    }
    assert [name for name, actor in actors.items() if actor.records] == ["edge"]
    assert actors["cloud"].place == Placement("cloud")
    assert actors["10.0.0.7"].place == Placement("edge", "10.0.0.7")


def test_unread_sensors_of_a_flying_robot_run_all_the_same(environment: Environment) -> None:
    """The camera is recorded, odometry can be polled, though no analysis reads them."""
    environment.get_robot_by_id("drone").navigate(hop((1, 0)))
    made = plan(environment)
    assert [one.stream for one in made.cameras] == ["drone/cam"]
    assert [sensor.id for sensor in made.drones[0][0].sensors] == ["odom"]
    assert {"drone/cam", "drone/odom", "drone/@state", "drone/@status"} <= set(made.recorded)


def test_a_simulated_vehicle_is_observed_when_others_measure_it(environment: Environment) -> None:
    """At the times of cameras and external sources, beside the loop's own; never in real time."""
    env = environment
    env.get_robot_by_id("drone").navigate(Weave().analyse(odometry(env)))
    Broken().analyse(camera(env))
    Ticker().deploy(env.get_compute_resource_by_id("edge")).instantiate()
    assert plan(env).observed == {"drone/cam": 10.0, "ticker": Ticker.rate}
    assert plan(env, 1.0).observed is None


def test_in_real_time_each_drone_has_its_own_actor(tmp_path: Path) -> None:
    """In simulated time one node flies them all."""
    content = {**FLAT, "robots": [robot("one"), robot("two", start=[0, 5, 0])]}
    env = Environment(Flyer(tmp_path).write(content))
    for name in ("one", "two"):
        env.get_robot_by_id(name).navigate(hop((1, 0)))
    assert [len(group) for group in plan(env, speed=1.0).drones] == [1, 1]
    assert [len(group) for group in plan(env).drones] == [2]


def test_simulated_drones_of_a_large_flight_share_actors(tmp_path: Path) -> None:
    """Evenly, and fewer at a faster pace; eight or fewer, and real ones, have each their own."""

    def groups(simulated: int, speed: float) -> list[int]:
        robots = [robot(f"s{number}", start=[0, 5 * number, 0]) for number in range(simulated)]
        robots.insert(3, {"id": "real", "driver": "tello", "limits": {}})
        env = Environment(Flyer(tmp_path).write({**FLAT, "robots": robots}))
        for one in robots:
            env.get_robot_by_id(one["id"]).navigate(hop((1, 0)))
        made = plan(env, speed=speed)
        (alone,) = [group for group in made.drones if group[0].robot.id == "real"]
        assert len(alone) == 1
        assert len({spec.robot.id for group in made.drones for spec in group}) == simulated + 1
        return [len(group) for group in made.drones if group is not alone]

    assert groups(8, 1.0) == [1] * 8
    assert groups(9, 1.0) == [9]
    assert groups(23, 1.0) == [7, 8, 8]
    assert groups(9, 0.5) == [9]
    assert groups(12, 4.0) == [2] * 6
    assert groups(9, 50.0) == [1] * 9


def test_triggers_belong_to_whoever_publishes_the_results(environment: Environment) -> None:
    """Of what is scheduled the dispatcher, which alone sees what the cloud has found."""
    drone = environment.get_robot_by_id("drone")
    drone.navigate(hop((1, 0)))
    seen = SyntheticAnalytics("seen", 5, 5).trigger(drone.end_mission)
    seen.deploy(environment.get_compute_resource_by_id("cloud")).analyse(camera(environment))
    Above(1.0).trigger(drone.end_mission).analyse(odometry(environment))
    scheduler = environment.trajectory_scheduler()
    made = make_plan(
        Session(environment.config, 1.0),
        environment.graph,
        environment.compute(),
        scheduler,
        load_scheduler("cld"),
    )
    assert made.dispatch is not None
    (managed,) = made.dispatch.managed
    assert len(managed.triggers) == 1
    counts = {spec.stream: len(spec.triggers) for spec in made.analyses}
    assert sorted(counts.values()) == [0, 1]
    assert counts["drone/above"] == 1


def _watched(folder: Path, simulation: dict[str, Any]) -> Environment:
    """Two analyses of a camera, one that follows the first; an edge and a simulated cloud."""
    compute = [{"id": "edge"}, {"id": "far", "kind": "cloud", "simulated": True, "executors": 3}]
    content = {**CONTENT, "compute": compute, "simulation": {"world": "empty", **simulation}}
    env = Environment(Flyer(folder).write(content))
    edge = env.get_compute_resource_by_id("edge")
    for name in ("one", "two"):
        SyntheticAnalytics(name, 0, 0).deploy(edge).analyse(camera(env))
    env.get_robot_by_id("drone").navigate(hop((1, 0)))
    return env


def _dispatched(env: Environment, speed: float | None = None) -> FlightPlan:
    session, dems = Session(env.config, speed), load_scheduler("dems")
    return make_plan(session, env.graph, env.compute(), env.trajectory_scheduler(), dems)


def test_a_simulated_cloud_is_there_where_executions_take_mission_time(tmp_path: Path) -> None:
    """It has slots and no process; in real time, and where nothing takes time, it is left out."""
    env = _watched(tmp_path, {"execution_times": "nominal"})
    dispatch = _dispatched(env).dispatch
    assert dispatch is not None
    assert (dispatch.resources.cloud_slots, dispatch.cloud) == (3, ())
    assert all(one.offloadable for one in dispatch.managed)
    for speed, simulation in ((1.0, {"execution_times": "nominal"}), (None, {})):
        dispatch = _dispatched(_watched(tmp_path, simulation), speed).dispatch
        assert dispatch is not None
        assert (dispatch.resources.cloud_slots, dispatch.cloud) == (0, ())
        assert not any(one.offloadable for one in dispatch.managed)


def test_nothing_flies_on_a_simulated_cloud_in_real_time(tmp_path: Path) -> None:
    """An analysis that is deployed there has no place; in simulated time it has one."""
    env = _watched(tmp_path, {"execution_times": "nominal"})
    SyntheticAnalytics("far_off", 0, 0).deploy(env.get_compute_resource_by_id("far")).analyse(
        camera(env)
    )
    assert _dispatched(env).dispatch is not None
    with pytest.raises(GraphError, match=r"far_off is deployed on far, which is simulated"):
        _dispatched(env, 1.0)
