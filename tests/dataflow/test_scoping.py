"""Sensors, tasks and navigation belong to a robot: one application flies any drone of a fleet."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from flying import FLAT, Flyer, hop, recorded, robot
from hypothesis import given
from hypothesis import strategies as st

from aerodaas import AeroListData, Environment, Waypoint
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.config.model import validated
from aerodaas.config.overrides import overridden
from aerodaas.errors import AmbiguousIdError, ConfigError, GraphError, UnknownIdError
from aerodaas.identifiers import find_scoped, short, told
from aerodaas.mission.commands import AddNavigation
from aerodaas.runtime.plan import FlightPlan, make_plan
from aerodaas.runtime.session import Session
from aerodaas.schedulers.analytics.registry import load_scheduler

CAMERA = {"id": "cam", "rate": 5, "settings": {"width": 64, "height": 36}}
FLEET: dict[str, Any] = {
    **FLAT,
    "robots": [robot("left", sensors=[CAMERA]), robot("right", sensors=[CAMERA])],
}

ids = st.sampled_from(["a", "b", "c", "cam", "left", "edge"])
several = st.lists(ids, max_size=3, unique=True)
fleets = st.dictionaries(ids, several, min_size=1, max_size=3)


@pytest.fixture
def env(tmp_path: Path) -> Environment:
    """Two drones whose cameras are called the same."""
    return Environment(Flyer(tmp_path).write(FLEET))


def described(fleet: dict[str, list[str]], own: list[str], compute: list[str]) -> dict[str, Any]:
    """An environment file with these sensors by robot, sensors of its own, and resources."""
    return {
        "robots": [
            {"id": name, "sensors": [{"id": one} for one in sensors]}
            for name, sensors in fleet.items()
        ],
        "sensors": [{"id": one} for one in own],
        "compute": [{"id": one} for one in compute],
    }


def planned(env: Environment, analytics: str | None = None) -> FlightPlan:
    """The plan of what was built, without Ray."""
    env.place_entries()
    dispatch = load_scheduler(analytics) if analytics else None
    scheduler = env.trajectory_scheduler()
    return make_plan(Session(env.config, 1.0), env.graph, env.compute(), scheduler, dispatch)


@given(st.lists(st.builds("{}/{}".format, ids, ids) | ids, unique=True), ids)
def test_a_name_finds_one_or_nothing(known: list[str], wanted: str) -> None:
    """The full name always; the short one where just one bears it; else the choice is told."""
    fitting = [name for name in known if short(name) == wanted]
    for name in known:
        assert find_scoped("thing", name, known) == name
    if wanted in known:
        return
    if len(fitting) == 1:
        assert find_scoped("thing", wanted, known) == fitting[0]
    elif fitting:
        with pytest.raises(AmbiguousIdError, match=" or ".join(sorted(fitting))):
            find_scoped("thing", wanted, known)
    else:
        with pytest.raises(UnknownIdError):
            find_scoped("thing", wanted, known)


@given(fleets, several, several, ids, st.floats(0.5, 50))
def test_an_override_changes_one_thing_or_is_refused(
    fleet: dict[str, list[str]], own: list[str], compute: list[str], wanted: str, rate: float
) -> None:
    """Never two, and never one of several that could have been meant."""
    config = validated(described(fleet, own, compute), "here")
    sensors = {sensor.full_id: sensor for sensor in config.all_sensors()}
    bearers = [*fleet, *own, *compute, *(one for many in fleet.values() for one in many)]
    if bearers.count(wanted) > 1:
        with pytest.raises(AmbiguousIdError, match="say "):
            overridden(config, {f"{wanted}.rate": rate})
    elif not bearers.count(wanted):
        with pytest.raises(UnknownIdError):
            overridden(config, {f"{wanted}.rate": rate})
    for robot_id, many in fleet.items():
        for one in many:
            name = f"{robot_id}/{one}"
            changed = overridden(config, {f"{name}.rate": rate})
            after = {sensor.full_id: sensor.rate for sensor in changed.all_sensors()}
            assert after == {full: it.rate for full, it in sensors.items()} | {name: rate}
    for one in own:
        changed = overridden(config, {f"sensors/{one}.rate": rate})
        assert next(it for it in changed.sensors if it.id == one).rate == rate
        assert changed.robots == config.robots


def test_one_application_flies_any_drone_of_a_fleet(env: Environment) -> None:
    """By the short name at the robot, by the full one anywhere; streams are the robots' own."""
    for name in ("left", "right"):
        drone = env.get_robot_by_id(name)
        assert drone.get_sensor_by_id("cam").get_data_stream().name == f"{name}/cam"
        assert drone.get_sensor_by_id(f"{name}/cam").get_data_stream().name == f"{name}/cam"
        assert env.get_env_sensor_by_id(f"{name}/cam").get_data_stream().name == f"{name}/cam"
        assert env.is_robot_sensor_available(f"{name}/cam")
    assert env.is_robot_sensor_available("cam")
    assert not env.is_robot_sensor_available("right/eye")
    with pytest.raises(AmbiguousIdError, match="say left/cam or right/cam"):
        env.get_env_sensor_by_id("cam")
    with pytest.raises(UnknownIdError, match="sensor of left"):
        env.get_robot_by_id("left").get_sensor_by_id("right/cam")


def test_a_camera_is_of_its_own_robots_kind() -> None:
    """Though another robot's is written in the same words."""
    tello = {"id": "t", "driver": "tello", "sensors": [{"id": "cam"}]}
    config = validated({"robots": [{"id": "s", "sensors": [{"id": "cam"}]}, tello]}, "here")
    drivers = [config.camera_driver(sensor) for sensor in config.all_sensors()]
    assert drivers == ["simulated", "tello"]


def test_an_analysis_never_takes_a_sensors_stream(tmp_path: Path) -> None:
    """Though the sensor is not used before the analysis is there."""
    sensors = [CAMERA, {**CAMERA, "id": "eye"}]
    env = Environment(Flyer(tmp_path).write({**FLAT, "robots": [robot(sensors=sensors)]}))
    drone = env.get_robot_by_id("drone")
    model = SyntheticAnalytics("cam", 1, 1).deploy(env.get_compute_resource_by_id("edge"))
    results = model.analyse(drone.get_sensor_by_id("eye").get_data_stream())
    assert results.name != "drone/cam"
    assert drone.get_sensor_by_id("cam").get_data_stream().name == "drone/cam"
    assert env.graph.nodes["drone/cam"].kind == "sensor"


def two_models(env: Environment) -> None:
    """An analysis of one name on each drone."""
    edge = env.get_compute_resource_by_id("edge")
    for name in ("left", "right"):
        drone = env.get_robot_by_id(name)
        model = SyntheticAnalytics("model", 10, 20).deploy(edge)
        model.analyse(drone.get_sensor_by_id("cam").get_data_stream())
        drone.navigate(hop((1, 0)))


def test_tasks_are_told_by_robot(tmp_path: Path) -> None:
    """Each analysis has what is told of it; a name that fits two is refused."""
    tasks = {"left/model": {"benefit": 3}, "right/model": {"benefit": 4}}
    content = {**FLEET, "schedulers": {"tasks": tasks}}
    env = Environment(Flyer(tmp_path).write(content))
    two_models(env)
    dispatch = planned(env, "edf").dispatch
    assert dispatch is not None
    benefits = {one.stream: one.profile.benefit for one in dispatch.managed}
    assert benefits == {"left/model": 3, "right/model": 4}
    env = Environment(Flyer(tmp_path).write({**FLEET, "schedulers": {"tasks": {"model": {}}}}))
    two_models(env)
    with pytest.raises(AmbiguousIdError, match="say left/model or right/model"):
        planned(env, "edf")


@given(st.dictionaries(st.sampled_from(["m", "a/m", "b/m"]), st.integers()))
def test_what_is_told_in_full_comes_first(table: dict[str, int]) -> None:
    """The full name, or else the short one."""
    assert told("a/m", table) == table.get("a/m", table.get("m"))


def waypoint(name: str) -> AeroListData[Waypoint]:
    """One place to fly to."""
    return AeroListData([Waypoint(name, 2, 0, 2)])


def queued(env: Environment) -> dict[str, list[str]]:
    """Ids of the waypoints that each robot takes off with."""
    specs = [spec for group in planned(env).drones for spec in group]
    return {
        spec.robot.id: [
            stop.id
            for command in spec.initial
            if isinstance(command, AddNavigation)
            for stop in command.navigation.waypoints
        ]
        for spec in specs
    }


def test_navigation_is_addressed(env: Environment) -> None:
    """By the robot or by its id; each flies what is its own."""
    scheduler = env.trajectory_scheduler()
    env.get_robot_by_id("left").navigate(hop((1, 0)))
    scheduler.add_navigation(waypoint("mine"), robot=env.get_robot_by_id("left"))
    scheduler.addNavigation(waypoint("yours"), robot="right")
    assert queued(env) == {"left": ["wp0", "mine"], "right": ["yours"]}


def test_navigation_for_the_only_one_needs_no_address(env: Environment) -> None:
    """As before, in a file with others that stay behind, and whichever is called first."""
    env.trajectory_scheduler().add_navigation(waypoint("more"))
    env.get_robot_by_id("right").navigate(hop((1, 0)))
    assert queued(env) == {"right": ["wp0", "more"]}


def test_who_waits_before_the_start_starts_nothing(env: Environment) -> None:
    """There is nothing to wait for; only start_mission() flies."""
    drone = env.get_robot_by_id("left")
    drone.navigate(hop((1, 0)))
    drone.wait()
    env.wait()
    assert env.run is None
    assert queued(env) == {"left": ["wp0"]}


@pytest.mark.parametrize("early", [True, False])
def test_navigation_for_one_of_several_must_say_which(env: Environment, *, early: bool) -> None:
    """At the call where two fly already, else at the start; the application's line is told."""
    scheduler = env.trajectory_scheduler()
    message = r"left and right fly.*robot=drone(.|\n)*test_scoping\.py:.*add_navigation"
    if not early:
        scheduler.add_navigation(waypoint("whose"))
    env.get_robot_by_id("left").navigate(hop((1, 0)))
    env.get_robot_by_id("right").navigate(hop((1, 0)))
    if not early:
        with pytest.raises(GraphError, match=message):
            planned(env)
    else:
        with pytest.raises(GraphError, match=message):
            scheduler.add_navigation(waypoint("whose"))
        assert queued(env) == {"left": ["wp0"], "right": ["wp0"]}


def test_clearing_is_addressed(env: Environment) -> None:
    """One robot's additions are forgotten, the other's stay."""
    scheduler = env.trajectory_scheduler()
    for name in ("left", "right"):
        scheduler.add_navigation(waypoint(f"old_{name}"), robot=name)
    scheduler.clear_navigation(robot="left")
    scheduler.add_navigation(waypoint("new"), robot="left")
    assert queued(env) == {"right": ["old_right"], "left": ["new"]}


def test_a_robot_that_there_is_not_is_refused(env: Environment) -> None:
    """At the call."""
    with pytest.raises(UnknownIdError, match=r"'lefft'.*did you mean left\?"):
        env.trajectory_scheduler().add_navigation(waypoint("a"), robot="lefft")


def test_two_sensors_of_a_robot_are_told_apart() -> None:
    """Within one robot an id is still one sensor's."""
    with pytest.raises(ConfigError, match="more than one sensor of left is called cam"):
        validated({"robots": [robot("left", sensors=[CAMERA, CAMERA])]}, "here")


def test_a_fleet_flies_by_addresses(flyer: Flyer) -> None:
    """Each visits its own in the air, too; an addition without address changes nothing."""

    def application(env: Environment) -> None:
        for number, name in enumerate(("left", "right")):
            env.get_robot_by_id(name).navigate(hop((8, 6.0 * number), hover=600))

    places = [robot("left"), robot("right", start=[0, 6, 0])]
    with flyer.flying(application, {**FLAT, "robots": places}) as env:
        scheduler = env.trajectory_scheduler()
        with pytest.raises(GraphError, match="left and right fly"):
            scheduler.add_navigation(waypoint("whose"))
        extra = AeroListData([Waypoint("extra", 6, 0, 2, priority=0)])
        scheduler.add_navigation(extra, robot="right")
        run, end = env.launch(), time.monotonic() + 60
        while "extra" not in run.poll().robots["right"].mission.visited:
            assert time.monotonic() < end
            time.sleep(0.02)
        env.end_mission()
    assert "extra" not in recorded(run).robots["left"].visited
