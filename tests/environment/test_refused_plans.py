"""Waypoints, plug-ins and analyses that cannot fly are refused before Ray is started."""

from __future__ import annotations

import math
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from flying import FLAT, Flyer, robot

from aerodaas import (
    AeroListData,
    AeroNavigation,
    Analytics,
    Environment,
    Frame,
    NavigationType,
    VelocityCommand,
    Waypoint,
)
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.errors import AeroDaaSError, ConfigError, GraphError
from aerodaas.mission.commands import AddNavigation
from aerodaas.mission.rehearsal import rehearse
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

CAMERA = {"id": "cam", "rate": 5, "settings": {"width": 64, "height": 36}}
FENCE = {"geofence": {"polygon": [[-10, -10], [10, -10], [10, 10], [-10, 10]]}}


class ReachedError(Exception):
    """Everything was found to be in order."""


@pytest.fixture
def refusal(tmp_path: Path) -> Callable[..., str]:
    """What is said of an environment and an application, before Ray; empty if nothing is."""
    flyer = Flyer(tmp_path)

    def ask(
        drone: dict[str, Any],
        build: Callable[[Environment], None] = lambda _: None,
        *waypoints: Waypoint,
    ) -> str:
        with (
            flyer.options(speed=1.0),
            patch("aerodaas.actors.cluster.ray_cluster.begin"),
            patch("aerodaas.actors.cluster.ray_cluster.connect", side_effect=ReachedError),
        ):
            try:
                env = Environment(flyer.write({**FLAT, "robots": [drone]}))
                build(env)
                if waypoints or not env.graph.navigation:
                    places = waypoints or (Waypoint("a", 1, 0, 2),)
                    env.get_robot_by_id("drone").navigate(AeroListData(places))
                env.launch()
            except AeroDaaSError as error:
                return str(error)
            except ReachedError:
                return ""
        raise AssertionError("it flies without Ray")

    return ask


PLANS: dict[str, tuple[dict[str, Any], Callable[[], list[Waypoint]], str]] = {
    "outside the fence": (FENCE, lambda: [Waypoint("a", 50, 0, 2)], "'a': .* outside the geofence"),
    "the second one": (
        FENCE,
        lambda: [Waypoint("a", 5, 0, 2), Waypoint("b", 50, 0, 2)],
        "'b': .* outside the geofence",
    ),
    "above the ceiling": ({}, lambda: [Waypoint("a", 1, 0, 500)], "above the ceiling"),
    "beyond the range": ({}, lambda: [Waypoint("a", 2000, 0, 2)], "beyond the range of 1000 m"),
    "too far for the battery": (
        {"cruise_speed": 1.0, "max_speed": 2.0},
        lambda: [Waypoint("near", 5, 0, 2), Waypoint("far", 600, 0, 2)],
        "'far': the way there and home takes .* of a full battery, and 88%",
    ),
    "a deadline that is past": ({}, lambda: [Waypoint("a", 1, 0, 2, deadline=-1)], "is past"),
    "no home": ({}, lambda: [Waypoint("a", 13, 77, 9, waypoint_type="global")], "gives no home"),
    "one id twice": (
        {},
        lambda: [Waypoint("a", 1, 0, 2), Waypoint("a", 2, 0, 2)],
        "two waypoints are called 'a'",
    ),
    "a number that is none": ({}, lambda: [Waypoint("a", math.nan, 0, 2)], "finite number"),
    "no id": ({}, lambda: [Waypoint("", 1, 0, 2)], "an id is a text"),
    "an id that is a number": ({}, lambda: [Waypoint(3, 1, 0, 2)], "an id is a text"),  # type: ignore[arg-type]
    "a priority in words": (
        {},
        lambda: [Waypoint("a", 1, 0, 2, priority="high")],  # type: ignore[arg-type]
        "priority must be a whole number",
    ),
    "an outline that crosses itself": (
        {"geofence": {"polygon": [[0, 0], [5, 5], [5, 0], [0, 5]]}},
        lambda: [Waypoint("a", 1, 0, 2)],
        r"robot drone: limits\.geofence\.polygon .* crosses itself",
    ),
}


@pytest.mark.parametrize("case", PLANS)
def test_a_plan_that_cannot_be_flown(refusal: Callable[..., str], case: str) -> None:
    """Each with the waypoint and the reason, once."""
    limits, waypoints, message = PLANS[case]
    with pytest.raises(AeroDaaSError, match=message) as said:  # noqa: PT012 - either may raise
        places = waypoints()
        raise ConfigError(refusal(robot(limits=limits), lambda _: None, *places))
    assert str(said.value).count("waypoint 'b'") <= 1


def test_what_can_be_flown_goes_on_to_ray(refusal: Callable[..., str]) -> None:
    """Waypoints of every kind, and commands."""
    places = [Waypoint("a", 5, 0, 2), Waypoint("b", 5, 5, 2, waypoint_type="local", priority=1)]
    assert refusal(robot(limits=FENCE), lambda _: None, *places) == ""

    def steer(env: Environment) -> None:
        command = AeroNavigation(NavigationType.DISTANCE_DRIVEN, [VelocityCommand(forward=1.0)])
        env.get_robot_by_id("drone").navigate(command)

    assert refusal(robot(limits=FENCE), steer) == ""


@pytest.mark.parametrize(("kind", "refused"), [("relative", False), ("local", True)])
def test_where_a_vehicle_of_its_own_stands_is_not_known(
    kind: str,
    refused: bool,  # noqa: FBT001
) -> None:
    """What is relative to it may well be inside the fence; its own actor will see."""
    environment = EnvironmentConfig.model_validate(
        {"robots": [{"id": "drone", "driver": "mavlink", "limits": FENCE}]}
    )
    navigation = AeroListData([Waypoint("a", 50, 0, 2, waypoint_type=kind)])
    command = AddNavigation(OrderedScheduler().generate_navigation(navigation))
    if refused:
        with pytest.raises(AeroDaaSError, match="outside the geofence"):
            rehearse(environment.robots[0], [command], environment, OrderedScheduler())
    else:
        rehearse(environment.robots[0], [command], environment, OrderedScheduler())


@pytest.mark.parametrize("given", [None, [Waypoint("a", 1, 0, 2)], 3])
def test_navigation_of_another_type(refusal: Callable[..., str], given: Any) -> None:  # noqa: ANN401
    """With what it could be."""
    said = refusal(robot(), lambda env: env.get_robot_by_id("drone").navigate(given))
    assert "drone navigates by AeroListData" in said
    assert f"not by {type(given).__name__}" in said


class Bot:
    """A vehicle that has no methods."""

    def __init__(self, *_: object) -> None: ...


class Whole(Bot):
    """A vehicle that has all of them, which nobody calls."""

    connect = read = preflight = take_off = send = hold = return_home = land = close = print


def test_plug_ins_that_are_none(
    refusal: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first fault, with what is missing, and what to do instead."""
    module = types.ModuleType("strange")
    vars(module).update(Bot=Bot, Whole=Whole, number=3)
    monkeypatch.setitem(sys.modules, "strange", module)
    said = refusal(robot(driver="strange:Bot"))
    assert "robot drone: driver 'strange:Bot' is no vehicle, for it has no connect, read" in said
    assert "is no class but 3" in refusal(robot(driver="strange:number"))
    other = robot(sensors=[{**CAMERA, "driver": "strange:Bot"}])
    assert "driver 'strange:Bot' is no camera, for it has no open, capture, close" in refusal(other)
    # The camera of a robot is by default of its robot's own kind.
    said = refusal(robot(driver="strange:Whole", sensors=[CAMERA]))
    assert "sensor drone/cam: driver 'strange:Whole' is no camera" in said
    assert 'its robot\'s driver was taken: give the sensor a "driver" of its own' in said


class Silent(Analytics[float]):
    """Forgets what it is for."""


class Narrow(Analytics[float]):
    """Takes an item only."""

    def process(self, item: Frame) -> float:  # type: ignore[override]
        """Return the mean."""
        return float(item.image.mean())


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Silent, r"Silent (drone/silent) has no process(self, item, context)"),
        (Narrow, r"Narrow (drone/narrow): process must take an item and a context, as in process("),
    ],
)
def test_analyses_that_could_not_work(
    refusal: Callable[..., str], kind: type[Analytics[float]], message: str
) -> None:
    """Not first in flight, once for each frame."""

    def build(env: Environment) -> None:
        camera = env.get_robot_by_id("drone").get_sensor_by_id("cam").get_data_stream()
        kind().deploy(env.get_compute_resource_by_id("edge")).analyse(camera)

    assert message in refusal(robot(sensors=[CAMERA]), build)


def test_what_an_analysis_produces_is_in_its_brackets() -> None:
    """Unless the class says it, or its base."""

    class Says(Analytics[float]):
        produces = str

    class Follows(Narrow): ...

    class Anything(Analytics[Any]): ...

    assert [kind.produces for kind in (Silent, Says, Follows, Anything)] == [
        float, str, float, object,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("compute", "message"),
    [
        ([{"id": "e", "executors": 0}], r"compute\.0\.executors: .* not 0 \(of e\)"),
        ([{"id": "x", "kind": "http"}], r'compute\.0: the kind "http" needs an endpoint'),
        ("automatic", r"compute: Input should be 'auto', not 'automatic'"),
    ],
)
def test_pydantics_own_words_are_left_out(compute: object, message: str) -> None:
    """Neither the types that it tried nor the names of its errors."""
    with pytest.raises(ConfigError, match=message) as said:
        validated({"robots": [{"id": "d"}], "compute": compute}, "file.json")
    assert "Value error" not in str(said.value)
    assert "literal[" not in str(said.value)


def test_nothing_is_measured_more_than_a_thousand_times_a_second(
    refusal: Callable[..., str],
) -> None:
    """Time would not go on between two of its items."""
    said = refusal(robot(sensors=[{**CAMERA, "rate": 1e9}]))
    assert "rate: Input should be less than or equal to 1000" in said


def test_the_graph_error_has_a_line(refusal: Callable[..., str]) -> None:
    """As all that the application did wrong."""
    with pytest.raises(GraphError, match="at test_refused_plans"):
        raise GraphError(refusal(robot(), lambda env: env.get_robot_by_id("drone").navigate(None)))
