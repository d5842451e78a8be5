"""The paper's API table, walked: each name exists with its inputs and outputs, in two spellings."""

from __future__ import annotations

import inspect
import json
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import pytest

import aerodaas
from aerodaas import (
    AeroData,
    AeroListData,
    AeroNavigation,
    AeroStreamData,
    Analytics,
    Environment,
    NavigableAnalytics,
    NearestNeighborScheduler,
    Odometry,
    Waypoint,
)
from aerodaas.dataflow import interfaces
from aerodaas.dataflow.graph import Graph
from aerodaas.dataflow.interfaces import IAeroData, ICompute, INavigate, IRobot, ISensor
from aerodaas.dataflow.names import snake_case


class Row(NamedTuple):
    """One row of the table, as printed."""

    interface: str
    function: str
    inputs: str
    output: str


TABLE = [
    Row("IEnvironment", "hasEnvSensors", "--", "boolean"),
    Row("IEnvironment", "getEnvSensors", "--", "List<ISensor>"),
    Row("IEnvironment", "getEnvSensorByID", "str", "ISensor"),
    Row("IEnvironment", "getEnvRobots", "--", "List<IRobot>"),
    Row("IEnvironment", "getRobotByID", "str", "IRobot"),
    Row("IEnvironment", "isRobotSensorAvailable", "str", "boolean"),
    Row("IEnvironment", "getRobotSensors", "--", "List<ISensor>"),
    Row("IEnvironment", "getComputeResources", "--", "List<ICompute>"),
    Row("IEnvironment", "getComputeResourceByID", "str", "ICompute"),
    Row("IEnvironment", "setTrajectoryScheduler", "INavigate", "--"),
    Row("IEnvironment", "setAnalyticsScheduler", "str", "--"),
    Row("IRobot", "startMission", "--", "--"),
    Row("IRobot", "endMission", "--", "--"),
    Row("IRobot", "pauseMission", "--", "--"),
    Row("IRobot", "resumeMission", "--", "--"),
    Row("IRobot", "hasSensors", "--", "boolean"),
    Row("IRobot", "getSensors", "--", "List<ISensor>"),
    Row("IRobot", "getSensorByID", "str", "ISensor"),
    Row("IRobot", "isNavigable", "--", "boolean"),
    Row("IRobot", "navigate", "IAeroData<AeroNav>", "--"),
    Row("ISensor", "getSensorProperty", "str", "str"),
    Row("ISensor", "getSensorID", "--", "str"),
    Row("ISensor", "getDataStream", "--", "AeroStreamData"),
    Row("IAeroData", "getData", "--", "E"),
    Row("IAeroData", "setData", "E", "--"),
    Row("ICompute", "getComputeProperties", "--", "dict"),
    Row("IAnalyse", "analyse", "IAeroData", "IAeroData"),
    Row("IAnalyse", "instantiate", "--", "IAeroData"),
    Row("IAnalyse", "deploy", "ICompute", "--"),
    Row("INavigate", "generateNavigation", "IAeroData<AeroNav>", "IAeroData<AeroNav>"),
    Row("INavigate", "addNavigation", "IAeroData<AeroNav>", "--"),
    Row("INavigate", "clearNavigation", "--", "--"),
    Row("INavigableAnalyse", "generateNavigation", "IAeroData", "IAeroData<AeroNav>"),
]
TYPES: dict[str, type] = {
    "boolean": bool,
    "str": str,
    "dict": dict,
    "List<ISensor>": list,
    "List<IRobot>": list,
    "List<ICompute>": list,
    "ISensor": ISensor,
    "IRobot": IRobot,
    "ICompute": ICompute,
    "INavigate": INavigate,
    "IAeroData": IAeroData,
    "IAeroData<AeroNav>": IAeroData,
    "AeroStreamData": AeroStreamData,
}
CONTENT = {
    "robots": [
        {
            "id": "drone",
            "sensors": [{"id": "cam", "rate": 30}, {"id": "odom", "type": "odometry"}],
        }
    ],
    "sensors": [{"id": "gate_cam"}],
    "compute": [{"id": "edge", "kind": "edge"}],
}


class Height(Analytics[float]):
    """Analysis for the table."""

    accepts = (Odometry,)
    produces = float


class Come(NavigableAnalytics):
    """Navigation from an analysis, for the table."""

    accepts = (float,)


@pytest.fixture
def env(tmp_path: Path) -> Environment:
    """An environment with something of everything."""
    path = tmp_path / "environment.json"
    path.write_text(json.dumps(CONTENT))
    return Environment(path)


def implementations(env: Environment) -> dict[str, list[Any]]:
    """Objects that implement each interface of the table."""
    odometry = env.getRobotByID("drone").getSensorByID("odom")
    return {
        "IEnvironment": [env],
        "IRobot": [env.getRobotByID("drone")],
        "ISensor": [odometry, env.getEnvSensorByID("gate_cam")],
        "IAeroData": [AeroData(1), AeroListData([1]), odometry.getDataStream(), AeroNavigation()],
        "ICompute": [env.getComputeResourceByID("edge")],
        "IAnalyse": [Height(), Come()],
        "INavigate": [NearestNeighborScheduler(env)],
        "INavigableAnalyse": [Come()],
    }


def hints(function: Callable[..., Any]) -> dict[str, Any]:
    """Annotations of a method, resolved; the result's under `return`."""
    names = {**vars(interfaces), "AeroStreamData": AeroStreamData}
    names["AeroNavigation"] = AeroNavigation
    return get_type_hints(function, names)


def plain(annotation: Any) -> Any:  # noqa: ANN401
    """The class of an annotation without its parameters."""
    return get_origin(annotation) or annotation


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row.interface}.{row.function}")
def test_each_row_of_the_table(env: Environment, row: Row) -> None:
    """The name works in both spellings, takes the row's input and returns its output."""
    interface = getattr(aerodaas, row.interface)
    declared = getattr(interface, snake_case(row.function))
    for implementation in implementations(env)[row.interface]:
        assert isinstance(implementation, interface)
        method = getattr(implementation, snake_case(row.function))
        assert getattr(implementation, row.function) == method
        required = [
            parameter.name
            for parameter in inspect.signature(method).parameters.values()
            if parameter.default is inspect.Parameter.empty
        ]
        assert len(required) == (row.inputs != "--")
        given = hints(declared)
        result = given.pop("return", type(None))
        if row.inputs not in {"--", "E"}:
            (name,) = required
            wanted = plain(given[name])
            assert wanted is Any or issubclass(TYPES[row.inputs], wanted)
        if row.output in TYPES:
            assert issubclass(plain(result), TYPES[row.output])
        if row.output.startswith("List<"):
            assert get_args(result)[0].__name__ in row.output or get_args(result)[0] is ISensor[Any]


def test_the_names_without_a_flight_do_what_the_table_says(env: Environment) -> None:
    """What can be asked on the ground answers as the table describes."""
    drone = env.getRobotByID("drone")
    assert env.hasEnvSensors() is True
    assert [sensor.getSensorID() for sensor in env.getEnvSensors()] == ["gate_cam"]
    assert [one.robot_id for one in env.getEnvRobots()] == ["drone"]
    assert env.isRobotSensorAvailable("cam") is True
    assert env.isRobotSensorAvailable("gate_cam") is False
    assert [sensor.getSensorID() for sensor in env.getRobotSensors()] == ["cam", "odom"]
    (edge,) = env.getComputeResources()
    assert drone.hasSensors() is True
    assert drone.isNavigable() is True
    assert drone.getSensorByID("cam").getSensorProperty("rate") == "30.0"
    held = AeroData([1])
    held.setData([2])
    assert held.getData() == [2]
    scheduler = NearestNeighborScheduler(env)
    env.setTrajectoryScheduler(scheduler)
    env.setAnalyticsScheduler("dems")
    stream = drone.getSensorByID("odom").getDataStream()
    height = Height().deploy(edge).analyse(stream)
    navigation = Come().generateNavigation(height)
    assert (height.item, navigation.item) == (float, AeroNavigation)
    far, near = Waypoint("far", 9, 0, 2), Waypoint("near", 1, 0, 2)
    generated = scheduler.generateNavigation(AeroListData([far, near]))
    assert [waypoint.id for waypoint in generated.getData()] == ["far", "near"]
    scheduler.addNavigation(AeroListData([Waypoint("later", 2, 2, 2)]))
    assert len(scheduler.entries) == 1
    scheduler.clearNavigation()
    assert scheduler.entries == []


def test_both_of_the_papers_spellings_work(env: Environment) -> None:
    """The table writes ID, the listings write Id; start_mission is printed in snake_case, too."""
    drone = env.getRobotById("drone")
    assert drone is env.getRobotByID("drone") is env.get_robot_by_id("drone")
    assert drone.startMission == drone.start_mission
    with pytest.raises(AttributeError, match="fly_away"):
        drone.flyAway()
    with pytest.raises(AttributeError, match="flyaway"):
        drone.flyaway()


def test_every_public_name_is_there_and_documented() -> None:
    """`aerodaas.__all__` resolves, and everything in it says what it is."""
    names = vars(aerodaas)["__all__"]
    assert len(names) > 40
    for name in names:
        thing = getattr(aerodaas, name)
        assert isinstance(thing, type | types.FunctionType), name
        assert inspect.getdoc(thing), name
    assert set(names) <= set(dir(aerodaas))


def test_an_unknown_attribute_of_a_half_made_object_is_no_endless_question() -> None:
    """Copying and unpickling look attributes up before the constructor has run."""
    assert not hasattr(AeroStreamData.__new__(AeroStreamData), "noSuchThing")
    assert not hasattr(AeroStreamData(Graph(), "s", int), "__deepcopy__")
