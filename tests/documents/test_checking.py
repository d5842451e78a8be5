"""Check of a mission document without flying: one finding for each thing wrong, and no other."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from flying import Flyer, recorded
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.documents.checking import check_document
from aerodaas.environment.document.building import build_mission
from aerodaas.protocol.proposals import CheckReport, Finding
from aerodaas.service.rehearsal.findings import findings_of

FENCE = [[-20, -20], [40, -20], [40, 40], [-20, 40]]
ZONE = [[10, 2], [20, 2], [20, 14], [10, 14]]
CONTENT: dict[str, Any] = {
    "robots": [
        {
            "id": "drone",
            "sensors": [
                {"id": "odom", "type": "odometry"},
                {"id": "cam", "type": "camera", "settings": {"width": 64, "height": 36}},
            ],
            "limits": {
                "cruise_speed": 4.0,
                "max_speed": 6.0,
                "max_range": 50.0,
                "geofence": {"polygon": FENCE, "ceiling": 30.0, "no_fly": [ZONE]},
            },
        }
    ],
    "sensors": [{"id": "log", "type": "gps", "settings": {"path": "log.csv"}}],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty"},
}


def config(**limits: Any) -> EnvironmentConfig:  # noqa: ANN401 - settings
    """The environment, with other limits of the drone."""
    robot = CONTENT["robots"][0]
    changed = {**robot, "limits": {**robot["limits"], **limits}}
    return validated({**CONTENT, "robots": [changed]}, "the test's environment")


def mission(*waypoints: Mapping[str, Any], **more: Any) -> MissionDocument:  # noqa: ANN401
    """A document in which the drone flies these waypoints; `more` goes on top."""
    stops = [{"id": f"wp{i}", "x": 5, "y": 0, "z": 3, **one} for i, one in enumerate(waypoints)]
    content = {"navigation": [{"robot": "drone", "waypoints": stops}], **more}
    return MissionDocument.model_validate({"format": "aerodaas-mission", "version": 1, **content})


def analysis(name: str, **settings: Any) -> dict[str, Any]:  # noqa: ANN401
    """An entry of an analysis of the drone's camera."""
    entry = {"id": "drone/it", "analysis": name, "reads": ["drone/cam"]}
    return {**entry, "settings": settings}


def watched(entry: Mapping[str, Any], **more: Any) -> MissionDocument:  # noqa: ANN401
    """A flight with one analysis."""
    return mission({}, sensors=["drone/cam"], analyses=[entry], **more)


def followed(entry: Mapping[str, Any]) -> MissionDocument:
    """A flight by one analysis."""
    return watched(entry, navigation=[{"robot": "drone", "stream": entry["id"]}])


def only(report: CheckReport) -> Finding:
    """The one finding of a report."""
    assert not report.passed
    (found,) = report.findings
    assert found.remedy
    return found


def test_a_mission_within_all_limits_passes_with_a_forecast_of_its_way() -> None:
    """Up to 1.5 m, 5 m east, back and down, from a full battery."""
    report = check_document(mission({"z": 1.5, "hover_duration": 10}), config(), minutes=5)
    assert report.passed
    (forecast,) = report.forecasts
    assert (forecast.robot, forecast.waypoints, forecast.highest) == ("drone", 1, 1.5)
    assert forecast.distance == pytest.approx(1.5 + 5 + 5 + 1.5)
    assert forecast.seconds == pytest.approx(1.0 + 5 / 4 + 10 + 5 / 4 + 3)
    assert forecast.battery_used is not None
    assert 0.01 < forecast.battery_used < 0.05


@pytest.mark.parametrize(
    ("waypoint", "check", "measured", "limit"),
    [
        ({"x": 60, "y": 60, "limits": {"max_range": 500}}, "fence", -math.hypot(20, 20), 0.5),
        ({"x": 39.8}, "fence", 0.2, 0.5),
        ({"x": 15, "y": 8}, "no_fly", -5.0, 0.5),
        ({"x": 9.7, "y": 8}, "no_fly", 0.3, 0.5),
        ({"z": 150, "limits": {"max_range": 500}}, "ceiling", 150, 30),
        ({"z": 0.1}, "floor", 0.1, 0.3),
        ({"x": 39, "y": 39}, "range", math.hypot(39, 39, 3), 50),
        ({"speed": 9}, "speed", 9, 6),
    ],
)
def test_a_waypoint_beyond_a_limit_is_found_with_place_and_figures(
    waypoint: dict[str, Any], check: str, measured: float, limit: float
) -> None:
    """One waypoint, one limit, one finding."""
    limits = waypoint.pop("limits", {})
    found = only(check_document(mission({}, waypoint), config(**limits)))
    assert (found.check, found.robot, found.waypoint) == (check, "drone", "wp1")
    assert found.place is not None
    assert found.measured == pytest.approx(measured, abs=0.01)
    assert found.limit == pytest.approx(limit)


def test_the_remedy_of_a_place_outside_is_a_place_that_passes() -> None:
    """Who moves the waypoint as told is done."""
    found = only(check_document(mission({"x": 60}), config(max_range=100)))
    assert "(39.5, 0.0, 3.0)" in found.remedy
    assert check_document(mission({"x": 39.5}), config()).passed


def test_a_way_across_a_no_fly_zone_is_longer_by_the_way_around_it() -> None:
    """The drone flies around by itself, and the forecast knows."""
    across = check_document(mission({"x": 30, "y": 8, "z": 1.5}), config())
    assert across.passed
    assert across.forecasts[0].distance is not None
    assert across.forecasts[0].distance > 2 * (math.hypot(30, 8) + 1.5)


def test_a_place_that_no_way_within_the_fence_reaches_is_found() -> None:
    """A wall of no-fly from edge to edge parts the fence."""
    wall = [[10, -25], [12, -25], [12, 45], [10, 45]]
    limits = {"geofence": {"polygon": FENCE, "no_fly": [wall]}}
    found = only(check_document(mission({}, {"x": 30}), config(**limits)))
    assert (found.check, found.waypoint) == ("no_fly", "wp1")


@pytest.mark.parametrize(("charge", "passes"), [(1.0, True), (0.18, False), (0.27, False)])
def test_the_charge_has_to_last_for_all_waypoints(charge: float, *, passes: bool) -> None:
    """Below 25 % it takes off no more; above, it would turn back before the far waypoint."""
    far = mission(*({"x": x, "hover_duration": 30} for x in (5, 30)))
    report = check_document(far, config(), battery={"drone": charge})
    assert report.passed is passes
    if not passes:
        found = only(report)
        assert (found.check, found.unit) == ("battery", "%")
        assert found.measured is not None
        assert found.limit is not None
        assert found.measured < found.limit


def test_the_lease_has_to_last_until_the_landing() -> None:
    """A stay of two minutes takes longer than a lease of two."""
    stay = mission({"hover_duration": 120})
    assert check_document(stay, config(), minutes=3).passed
    found = only(check_document(stay, config(), minutes=2))
    assert (found.check, found.limit, found.unit) == ("lease", 120, "s")


def test_a_charge_that_allows_no_take_off_is_found_whatever_is_flown() -> None:
    """The way is an analysis', and 18 % are less than what a take-off needs."""
    follow = followed(analysis("CarFollowAnalytics"))
    assert check_document(follow, config(), battery={"drone": 0.5}).passed
    found = only(check_document(follow, config(), battery={"drone": 0.18}))
    assert (found.check, found.measured, found.limit) == ("battery", 18, 25)


@pytest.mark.parametrize(("order", "passes"), [("ab", True), ("ba", False)])
def test_deadlines_hold_for_the_way_as_planned(order: str, *, passes: bool) -> None:
    """The near waypoint after the far one is late; a scheduler that heeds deadlines turns them."""
    stops = {"a": {"id": "a", "x": 4, "deadline": 5}, "b": {"id": "b", "x": 30}}
    asked = [stops[one] for one in order]
    report = check_document(mission(*asked), config())
    assert report.passed is passes
    if not passes:
        found = only(report)
        assert (found.check, found.waypoint, found.limit) == ("deadline", "a", 5)
        heeding = mission(*asked).navigation[0].model_copy(update={"ordered": False})
        for scheduler in ("deadline", "optimal"):
            document = mission(*asked, trajectory_scheduler={"name": scheduler})
            document = document.model_copy(update={"navigation": [heeding]})
            assert check_document(document, config()).passed


def test_an_order_that_is_searched_in_flight_alone_misses_no_deadline_here() -> None:
    """The nearest waypoint first would be late; the search for the best order may not be."""
    stops = [{"id": "near", "x": 4, "hover_duration": 30}, {"id": "far", "x": 30, "deadline": 15}]
    for scheduler, passes in (("nearest_neighbor", False), ("optimal", True)):
        document = mission(*stops, trajectory_scheduler={"name": scheduler})
        free = document.navigation[0].model_copy(update={"ordered": False})
        document = document.model_copy(update={"navigation": [free]})
        assert check_document(document, config()).passed is passes


@pytest.mark.parametrize("scheduler", ["ordered", "optimal"])
def test_a_deadline_that_no_way_meets_is_found(scheduler: str) -> None:
    """Before the drone can be there at all."""
    late = mission({"deadline": 1.5}, trajectory_scheduler={"name": scheduler})
    found = only(check_document(late, config()))
    assert (found.check, found.limit) == ("deadline", 1.5)
    assert found.measured == pytest.approx(1 + math.hypot(5, 1.5) / 4, abs=0.1)


@pytest.mark.parametrize(
    ("name", "least"),
    [("PersonFollowAnalytics", 1.5), ("VipFollowAnalytics", 1.5), ("CarFollowAnalytics", 3.0)],
)
def test_people_and_cars_are_followed_from_a_distance(name: str, least: float) -> None:
    """The distance as given; a mission that keeps it passes."""
    found = only(check_document(followed(analysis(name, distance=0.3, height=2)), config()))
    assert (found.check, found.measured, found.limit) == ("follow_distance", 0.3, least)
    report = check_document(followed(analysis(name, distance=least, height=2)), config())
    assert report.passed
    assert report.forecasts[0].distance is None


def test_the_distance_that_an_analysis_takes_by_itself_counts() -> None:
    """A follower of the base class, which keeps two metres, may follow a car."""
    found = only(check_document(followed(analysis("FollowAnalytics")), config()))
    assert found.measured == pytest.approx(2)


@pytest.mark.parametrize(
    ("name", "arguments", "check"),
    [
        ("TowerInspectionAnalytics", {"top": 150}, "ceiling"),
        ("CarFollowAnalytics", {"height": 40}, "ceiling"),
        ("CarFollowAnalytics", {"height": 0.1}, "floor"),
    ],
)
def test_an_analysis_that_flies_keeps_to_the_heights(
    name: str, arguments: dict[str, Any], check: str
) -> None:
    """The height is an argument of the analysis."""
    found = only(check_document(followed(analysis(name, **arguments)), config()))
    assert found.check == check


@pytest.mark.parametrize(
    ("stops", "thing"),
    [
        ([{"x": 24, "y": 17, "z": 2}], "barn"),
        ([{"x": 5, "y": 17, "z": 3.4}, {"x": 36, "y": 17, "z": 3.4}], "barn"),
        ([{"x": 30, "y": 2, "z": 8}, {"x": 20, "y": 30, "z": 9}], ""),
    ],
)
def test_a_way_through_what_stands_in_the_simulated_world_is_found(
    stops: list[dict[str, Any]], thing: str
) -> None:
    """Into the barn, through it between two free places, and over it."""
    limits = {**CONTENT["robots"][0]["limits"], "geofence": {}}
    simulated = {**CONTENT["robots"][0], "limits": limits}
    content = {**CONTENT, "robots": [simulated], "simulation": {"world": "field"}}
    report = check_document(mission(*stops), validated(content, "the environment"))
    found = [one for one in report.findings if one.check == "clearance"]
    assert report.passed is not bool(thing)
    assert all(thing in one.text and one.measured is not None for one in found)
    assert bool(found) is bool(thing)
    link = {"driver": "mavlink", "settings": {"url": "udpin:127.0.0.1:14540"}}
    real = {**simulated, **link}
    elsewhere = validated({**content, "robots": [real]}, "the environment")
    assert check_document(mission(*stops), elsewhere).passed


def test_a_way_keeps_two_metres_above_people_who_stand(tmp_path: Path) -> None:
    """A waypoint 1 m over a head is found, one 3 m over it is not."""
    world = tmp_path / "world.json"
    somebody = {"kind": "person", "id": "ann", "at": [6, 0], "height": 1.7}
    world.write_text(json.dumps({"name": "one", "entities": [somebody]}))
    environment = validated({**CONTENT, "simulation": {"world": str(world)}}, "the environment")
    low = check_document(mission({"x": 6, "z": 2.7}), environment)
    assert {one.check for one in low.findings} == {"clearance"}
    assert "ann" in low.findings[0].text
    assert check_document(mission({"x": 6, "z": 5}), environment).passed


OTHER_ROBOT = [{"robot": "dron", "waypoints": [{"id": "a", "x": 1, "y": 1, "z": 2}]}]
CONDITION = {"target": "drone", "command": "end_mission", "when": {"$condition": "falen"}}
UNKNOWN: list[tuple[MissionDocument, str]] = [
    (mission({}, navigation=OTHER_ROBOT), "drone"),
    (mission({}, sensors=["drone/camm"]), "drone/cam"),
    (watched(analysis("PersonFolowAnalytics")), "PersonFollowAnalytics"),
    (watched(analysis("CrowdDensityAnalytics", limitt=3)), "limit"),
    (watched({**analysis("CrowdDensityAnalytics"), "compute": "edg"}), "edge"),
    (watched({**analysis("CrowdDensityAnalytics"), "reads": ["drone/cma"]}), "drone/cam"),
    (mission({}, trajectory_scheduler={"name": "nearest_neighbour"}), "nearest_neighbor"),
    (mission({}, trajectory_scheduler={"name": "optimal", "settings": {"buget": 1}}), "budget"),
    (mission({}, analytics_scheduler="demms"), "dems"),
    (mission({}, navigation=[{"robot": "drone", "stream": "drone/it"}]), "known"),
    (watched({**analysis("CrowdDensityAnalytics"), "triggers": [{"target": "drone/that"}]}), "it"),
    (
        watched({**analysis("GpsLoggerAnalytics", source={"$property": ["log", "pth"]})}),
        "path",
    ),
]


@pytest.mark.parametrize(("document", "nearest"), UNKNOWN)
def test_an_unknown_name_is_found_with_the_nearest_known(
    document: MissionDocument, nearest: str
) -> None:
    """Robots, sensors, analyses, settings, resources, streams, schedulers and properties."""
    found = check_document(document, config()).findings
    assert [one for one in found if one.check == "unknown_name" and nearest in one.text]


TWICE = {"robot": "drone", "waypoints": [{"id": "a", "x": 1, "y": 1, "z": 2}]}
READ = {**analysis("OnnxDetector"), "id": "drone/read"}
READER = {**analysis("CrowdDensityAnalytics"), "reads": ["drone/read"]}
WRONG: list[MissionDocument] = [
    mission(navigation=[]),
    mission({}, {"id": "wp0"}),
    mission({}, navigation=[TWICE, TWICE]),
    mission({}, navigation=[{"robot": "drone"}]),
    mission({"waypoint_type": "global", "x": 47, "y": 8}),
    mission({"actions": [{"type": "move_actuator", "actuator": "hook", "position": "open"}]}),
    watched(analysis("CrowdDensityAnalytics", limit="many")),
    watched(analysis("OnnxDetector", path="/etc/passwd")),
    watched({**analysis("CrowdDensityAnalytics"), "id": "it"}),
    watched({**analysis("TrackingAnalytics")}),
    watched({**analysis("CrowdDensityAnalytics"), "id": "it", "reads": []}),
    watched({**analysis("CrowdDensityAnalytics"), "task": {"benefit": -1}}),
    watched({**analysis("CrowdDensityAnalytics"), "triggers": [CONDITION]}),
    watched(
        {**analysis("CrowdDensityAnalytics"), "triggers": [{**CONDITION, "when": {"$here": 0}}]}
    ),
    mission({}, sensors=["drone/cam"], analyses=[READER, READ]),
    watched({"id": "drone/it", "here": {"produces": "bool"}, "reads": ["drone/cam"]}),
    followed(analysis("CrowdDensityAnalytics")),
]


@pytest.mark.parametrize("document", WRONG)
def test_what_would_not_be_built_or_flown_is_found(document: MissionDocument) -> None:
    """Empty, twice, without home, of the wrong type, or at a user's side that is not there."""
    assert only(check_document(document, config())).check == "document"


PLACE = st.floats(-60, 60)
STOPS = st.fixed_dictionaries(
    {"x": PLACE, "y": PLACE, "z": st.floats(-5, 60)},
    optional={
        "hover_duration": st.floats(0, 1e9),
        "speed": st.floats(1e-9, 1e9),
        "deadline": st.floats(-1e9, 1e9),
        "yaw": PLACE,
        "priority": st.integers(-3, 9),
        "above": st.sampled_from(["home", "sea", "ground"]),
        "waypoint_type": st.sampled_from(["local", "relative", "global", "global_relative"]),
        "id": st.sampled_from("ab"),
    },
)
VALUES = st.recursive(
    st.none() | st.booleans() | st.floats(-1e9, 1e9) | st.text("ab$/é", max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["$settings", "of", "$analysis", "settings", "$property", "distance"]),
            inner,
            max_size=3,
        )
    ),
    max_leaves=8,
)
ENTRIES = st.fixed_dictionaries(
    {
        "id": st.sampled_from(["drone/it", "it", "other/it"]),
        "analysis": st.sampled_from(["PersonFollowAnalytics", "OnnxDetector", "Other"]),
        "reads": st.lists(st.sampled_from(["drone/cam", "it", "log"]), max_size=2),
        "settings": st.dictionaries(
            st.sampled_from(["distance", "height", "detector", "path", "gains", "x"]),
            VALUES,
            max_size=3,
        ),
    }
)
NAVIGATION = st.fixed_dictionaries(
    {
        "robot": st.sampled_from(["drone", "other"]),
        "waypoints": st.lists(STOPS, max_size=5),
        "ordered": st.booleans(),
    },
    optional={
        "stream": st.sampled_from(["drone/it", "drone/cam", "none"]),
        "index": st.integers(0, 5),
        "deadline": st.floats(1e-3, 1e9),
        "clear_on": st.just("drone/it"),
    },
)
SCHEDULERS = st.sampled_from(["ordered", "nearest_neighbor", "priority", "deadline", "optimal"])


@settings(deadline=None, max_examples=60)
@given(
    st.lists(NAVIGATION, max_size=3),
    st.lists(ENTRIES, max_size=2),
    SCHEDULERS,
    st.floats(0, 1),
    st.floats(0.1, 60),
)
def test_any_document_has_a_report(
    navigation: list[dict[str, Any]],
    analyses: list[dict[str, Any]],
    scheduler: str,
    charge: float,
    minutes: float,
) -> None:
    """Whatever a valid document says, the check answers, and each finding has a remedy."""
    for number, entry in enumerate(navigation):
        for one, stop in enumerate(entry["waypoints"]):
            stop.setdefault("id", f"{number}.{one}")
            if stop.get("waypoint_type", "").startswith("global"):
                stop["x"] /= 2
    content = {"format": "aerodaas-mission", "version": 1, "navigation": navigation}
    content |= {"analyses": analyses, "trajectory_scheduler": {"name": scheduler}}
    document = MissionDocument.model_validate(content)
    report = check_document(document, config(), battery={"drone": charge}, minutes=minutes)
    assert report.passed is (not report.findings)
    assert all(one.text and one.remedy for one in report.findings)


INSIDE = st.tuples(st.floats(-12, 30), st.floats(-12, 30), st.floats(1.5, 8))


@pytest.mark.slow
@settings(deadline=None, max_examples=5, phases=[Phase.generate])
@given(st.lists(INSIDE, min_size=1, max_size=3))
def test_a_route_that_passes_is_flown_as_forecast(
    tmp_path_factory: pytest.TempPathFactory, places: list[tuple[float, float, float]]
) -> None:
    """The drone reaches every waypoint inside the fence, and lands about when it was to land."""
    document = mission(*({"x": x, "y": y, "z": z} for x, y, z in places))
    report = check_document(document, config())
    assume(report.passed)

    def build(environment: Any) -> None:  # noqa: ANN401 - an environment
        build_mission(document, environment, Path())

    flight = recorded(Flyer(tmp_path_factory.mktemp("flight")).fly(build, CONTENT))
    (forecast,) = report.forecasts
    assert forecast.seconds is not None
    found = findings_of(flight, config(), minutes=(1.5 * forecast.seconds + 30) / 60)
    # A drone is braked before an edge that it flies towards; it turns or stops there.
    assert [one.text for one in found if "setpoints" not in one.text] == []
