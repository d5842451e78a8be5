"""A mission document as a Python application: the same mission, short, and nobody else's code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, recorded, robot
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.config.options import RunOptions, current_options
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.documents.application import application_text
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.document.compiling import write_mission
from aerodaas.environment.document.flying import compile_application
from aerodaas.environment.environment import Environment
from aerodaas.environment.offering import run_file
from aerodaas.errors import GraphError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

APPS = Path(__file__).resolve().parents[2] / "apps"
CAMERA = {"id": "cam", "type": "camera", "settings": {"width": 64, "height": 36}}
SENSORS = [{"id": "odom", "type": "odometry"}, CAMERA]
CONTENT: dict[str, Any] = {**FLAT, "robots": [robot(sensors=SENSORS), robot("other")]}
MOST_LINES = 40


def mission(**parts: Any) -> MissionDocument:  # noqa: ANN401
    """A document with these parts."""
    names = {"name": "app", "environment": "environment.json"}
    content = {"format": "aerodaas-mission", "version": 1, **names, **parts}
    return MissionDocument.model_validate(content)


def flown(*stops: dict[str, Any], **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """Navigation by waypoints."""
    waypoints = [
        {"id": f"wp{number}", "x": 1, "y": 2, "z": 3, **one} for number, one in enumerate(stops)
    ]
    return {"robot": "drone", "waypoints": waypoints, **more}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an environment."""
    made = tmp_path_factory.mktemp("applications")
    Flyer(made).write(CONTENT)
    return made


def again(document: MissionDocument, folder: Path) -> MissionDocument:
    """What the application that is written for a document compiles to."""
    text = application_text(document)
    assert text.count("\n") <= MOST_LINES
    (folder / "app.py").write_text(text, encoding="utf-8")
    return compile_application(folder / "app.py", [])


def as_built(document: MissionDocument, folder: Path) -> MissionDocument:
    """What the document itself is written as once it is built."""
    current_options.set(RunOptions(view=False))
    environment = Environment(folder / "environment.json")
    build_mission(document, environment, folder)
    return write_mission(environment, document.name)


@pytest.mark.parametrize(
    "name",
    [
        "disaster_survey",
        "farm_survey",
        "fleet_survey",
        "search_and_rescue",
        "situation_awareness",
        "tower_inspection",
        "vehicle_tracking",
    ],
)
def test_the_application_of_a_document_compiles_to_it(name: str, tmp_path: Path) -> None:
    """Each that ships and that a document can hold."""
    document = compile_application(APPS / f"{name}.py", [])
    text = application_text(document)
    assert text.count("\n") <= MOST_LINES
    (tmp_path / f"{name}.py").write_text(text)
    environment = APPS / "environments" / document.environment
    assert compile_application(tmp_path / f"{name}.py", [], environment) == document


LIMITED = {"$settings": "LostPolicy", "of": {"coast": 0.5}}
NEAR = {"$settings": "Near", "of": {"place": [3, 4], "metres": 2.5}}


def watch(name: str, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """An analysis of the odometry."""
    entry = {"id": name, "analysis": "MonitoringAnalytics", "reads": ["drone/odom"]}
    return {**entry, "settings": {"readings": ["position"]}, **more}


FOLLOW = {"id": "drone/it", "analysis": "PersonFollowAnalytics", "reads": ["drone/cam"]}
EACH: list[dict[str, Any]] = [
    {"navigation": [flown({}, {"yaw": 1.5, "above": "home"})]},
    {"navigation": [flown({}, {"z": 4}, {"hover_duration": 2.5}, {"speed": 0.3})]},
    {"navigation": [flown({}, *[{"actions": [{"type": "take_photo"}]}] * 3)]},
    {"navigation": [flown({"waypoint_type": "local"}, {"priority": 2}, priority=3, ordered=False)]},
    {"navigation": [flown({}), flown({"id": "b"}, index=0, deadline=99)]},
    {"navigation": [flown({"id": "a"}, index=1), {**flown({}), "robot": "other"}]},
    {
        "sensors": ["drone/odom"],
        "analyses": [
            watch("drone/first"),
            watch("drone/second", reads=["drone/odom"], task={"benefit": 2.0}, compute="edge"),
            watch(
                "drone/monitoring",
                triggers=[
                    {"target": "drone", "command": "end_mission", "when": NEAR},
                    {"target": "drone/second", "when": None},
                ],
            ),
        ],
        "navigation": [flown({})],
        "trajectory_scheduler": {"name": "nearest_neighbor"},
        "analytics_scheduler": "dems",
    },
    {
        "sensors": ["drone/cam", "drone/odom"],
        "analyses": [{**FOLLOW, "settings": {"lost": LIMITED, "distance": 3}}],
        "navigation": [flown({}), {"robot": "drone", "stream": "drone/it", "clear_on": "drone/it"}],
        "trajectory_scheduler": {"name": "priority", "settings": {}},
    },
]


@pytest.mark.parametrize("parts", EACH)
def test_each_part_of_a_document_is_written(parts: dict[str, Any], folder: Path) -> None:
    """Waypoints that differ in anything, order, names, rates, triggers and schedulers."""
    document = as_built(mission(**parts), folder)
    assert again(document, folder) == document


def test_many_waypoints_are_a_table(folder: Path) -> None:
    """A hundred fit into 40 lines; thousands are better flown from the document."""
    stops = [{"x": number % 10, "y": number // 10, "yaw": number / 10} for number in range(100)]
    document = as_built(mission(navigation=[flown(*stops)]), folder)
    assert again(document, folder) == document
    with pytest.raises(GraphError, match="loop"):
        application_text(mission(navigation=[flown(*stops * 9)]))


NAMES = st.text(
    st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20
) | st.sampled_from(['"""', "{i}", 'a"0', "\\0", "0\n1", "'); raise SystemExit('"])


@settings(deadline=None, max_examples=40)
@given(st.lists(NAMES, min_size=1, max_size=4, unique=True), NAMES)
def test_names_of_strangers_stay_names(ids: list[str], title: str) -> None:
    """Whatever a waypoint or a mission is called, the application is Python and says just that."""
    document = mission(navigation=[flown(*({"id": one} for one in ids))])
    document = document.model_copy(update={"name": title, "environment": title})
    compile(application_text(document), "app.py", "exec")


@settings(deadline=None, max_examples=10)
@given(ids=st.lists(NAMES, min_size=3, max_size=4, unique=True))
def test_ids_come_back_as_they_were(ids: list[str], folder: Path) -> None:
    """Of any characters."""
    document = as_built(mission(navigation=[flown(*({"id": one} for one in ids))]), folder)
    assert again(document, folder) == document


@pytest.mark.parametrize(
    "parts",
    [
        {"analyses": [watch("drone/it", settings={"a=print(1), b": 1})]},
        {"analyses": [watch("drone/it", task={"x": 1, "lambda": 1})]},
        {"analyses": [watch("drone/it", settings={"readings": {"$code": "print()"}})]},
        {"analyses": [{"id": "drone/it", "here": {"produces": "bool"}, "reads": ["drone/odom"]}]},
        {"analyses": [watch("drone/it", reads=["drone/other"])]},
        {"analyses": [watch("drone/it", triggers=[{"target": "drone/other"}])]},
        {
            "analyses": [watch("drone/it")],
            "navigation": [flown({}, clear_on="drone/it")],
        },
    ],
)
def test_what_no_application_can_say_is_refused(parts: dict[str, Any]) -> None:
    """Arguments that are no names, code elsewhere, and streams that are not there."""
    with pytest.raises(GraphError):
        application_text(mission(**{"sensors": ["drone/odom"], "navigation": [flown({})], **parts}))


def test_the_application_flies_the_trajectory_of_its_document(tmp_path: Path) -> None:
    """To the last digit, in simulated time with the same seed."""
    stops = ({"x": 4, "y": 0}, {"x": 4, "y": 3, "z": 2.5}, {"x": 0, "y": 1})
    document = mission(navigation=[flown(*stops, ordered=False)])
    flyer = Flyer(tmp_path)

    def build(environment: Environment) -> None:
        build_mission(document, environment, tmp_path)

    of_document = recorded(flyer.fly(build, record=tmp_path / "document.mcap"))
    application = tmp_path / "app.py"
    application.write_text(application_text(document))
    record = tmp_path / "application.mcap"
    with flyer.options(application=application, record=record):
        run_file(application, [], current_options.get())
    with Recording.open(record) as recording:
        of_application = RecordedFlight.read(recording)
    one, other = of_document.robots["drone"], of_application.robots["drone"]
    assert len(one.position) > 100
    assert np.array_equal(one.position, other.position)
    assert set(one.visited) == set(other.visited) == {"wp0", "wp1", "wp2"}
