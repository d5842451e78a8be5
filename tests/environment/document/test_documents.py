"""Mission documents: what an application becomes, and what is refused on either side."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from flying import FLAT, hop, robot
from hypothesis import given
from hypothesis import strategies as st

from aerodaas import AeroNavigation, Analytics, Environment, NavigationType, VelocityCommand
from aerodaas.analytics import (
    BodyPoseEmergencyAnalytics,
    CombinedDetector,
    FollowAnalytics,
    GpsLoggerAnalytics,
    MonitoringAnalytics,
    Near,
    OnnxDetector,
    PersonFollowAnalytics,
    RemoteAnalytics,
    TowerInspectionAnalytics,
    VipDetectionAnalytics,
)
from aerodaas.analytics.base import Context
from aerodaas.analytics.models import DETECTOR
from aerodaas.analytics.models.registry import REGISTRY
from aerodaas.analytics.people.body_pose import hand_raised
from aerodaas.config.options import RunOptions, current_options
from aerodaas.dataflow.mission_document import MissionDocument, read_mission
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.document.compiling import write_mission
from aerodaas.environment.document.flying import compile_application, fly_mission
from aerodaas.errors import AeroDaaSError, ConfigError, GraphError
from aerodaas.following.follow_settings import FollowGains, LostPolicy
from aerodaas.messages.frames import Frame
from aerodaas.messages.readings import Readings
from aerodaas.schedulers.trajectory.optimal import OptimalScheduler

APPS = Path(__file__).resolve().parents[3] / "apps"
SHIPPED = (
    "crowd_watch",
    "disaster_survey",
    "farm_survey",
    "fleet_survey",
    "search_and_rescue",
    "situation_awareness",
    "tower_inspection",
    "vehicle_tracking",
)
CONTENT: dict[str, Any] = {
    **FLAT,
    "robots": [
        {
            "id": "drone",
            "sensors": [
                {"id": "odom", "type": "odometry"},
                {"id": "cam", "type": "camera", "settings": {"width": 64, "height": 36}},
            ],
        }
    ],
    "compute": [{"id": "edge", "kind": "edge"}],
}


@pytest.fixture
def environment(tmp_path: Path) -> Callable[[], Environment]:
    """Makes fresh environments of one file."""
    (tmp_path / "environment.json").write_text(json.dumps(CONTENT))

    def make() -> Environment:
        current_options.set(RunOptions(view=False))
        return Environment(tmp_path / "environment.json")

    return make


def fly(env: Environment) -> None:
    """Two waypoints."""
    env.get_robot_by_id("drone").navigate(hop((6, 0), (6, 6)))


def camera(env: Environment) -> Any:  # noqa: ANN401 - a stream
    """The drone's camera."""
    return env.get_robot_by_id("drone").get_sensor_by_id("cam").get_data_stream()


def odometry(env: Environment) -> Any:  # noqa: ANN401 - a stream
    """The drone's odometry."""
    return env.get_robot_by_id("drone").get_sensor_by_id("odom").get_data_stream()


def again(document: MissionDocument, env: Environment, models: Path) -> MissionDocument:
    """What a document becomes that was built and written once more."""
    through = MissionDocument.model_validate_json(document.text())
    build_mission(through, env, models)
    return write_mission(env, document.name)


@pytest.mark.parametrize("name", [name for name in SHIPPED if name != "crowd_watch"])
def test_an_application_survives_the_way_into_a_document_and_back(
    name: str, tmp_path: Path
) -> None:
    """Each that ships: the graph built from its document is written as the same document."""
    document = compile_application(APPS / f"{name}.py", [])
    current_options.set(RunOptions(view=False))
    env = Environment(APPS / "environments" / document.environment)
    assert again(document, env, tmp_path) == document
    assert document.navigation


def test_a_model_by_name_is_written_by_its_checksum(
    environment: Callable[[], Environment], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever has fetched the same model flies the document; nobody else does."""
    content = DETECTOR.read_bytes() + b"\x72\x00"  # an empty entry of metadata
    fetched = tmp_path / "fetched"
    fetched.mkdir()
    (fetched / "mine.onnx").write_bytes(content)
    sha256 = hashlib.sha256(content).hexdigest()
    model = replace(REGISTRY["yolox-nano"], name="mine", sha256=sha256)
    monkeypatch.setitem(REGISTRY, "mine", model)
    monkeypatch.setenv("AERODAAS_MODELS", str(fetched))
    env = environment()
    edge = env.get_compute_resource_by_id("edge")
    people = OnnxDetector("mine", classes=["person"]).deploy(edge).analyse(camera(env))
    PersonFollowAnalytics().deploy(edge).analyse(people)
    fly(env)
    (fetched / "mine.onnx").rename(tmp_path / "away")
    written = write_mission(env, "by name")  # its checksum is known: no file is read for it
    (tmp_path / "away").rename(fetched / "mine.onnx")
    assert f'"sha256": "{sha256}"' in written.text()
    assert again(written, environment(), tmp_path) == written
    monkeypatch.setenv("AERODAAS_MODELS", str(tmp_path))
    with pytest.raises(GraphError, match=r"no model 'mine.onnx' with the SHA-256"):
        again(written, environment(), tmp_path)


def test_models_that_a_document_does_not_name_are_not_read(
    environment: Callable[[], Environment], tmp_path: Path
) -> None:
    """One that cannot be read is in no other document's way."""
    (tmp_path / "broken.onnx").mkdir()
    env = environment()
    edge = env.get_compute_resource_by_id("edge")
    OnnxDetector(DETECTOR).deploy(edge).analyse(camera(env))
    fly(env)
    written = write_mission(env, "shipped")
    assert again(written, environment(), tmp_path) == written


def test_settings_of_every_kind_come_back(
    environment: Callable[[], Environment], tmp_path: Path
) -> None:
    """Numbers, texts, dataclasses, nested analyses, models, conditions, output and schedulers."""
    env = environment()
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")
    own = tmp_path / "models" / "own.onnx"
    own.parent.mkdir()
    own.write_bytes(DETECTOR.read_bytes())
    vests = VipDetectionAnalytics(own, min_score=0.4).deploy(edge).analyse(camera(env))
    FollowAnalytics(
        ("vest",),
        3.0,
        gains=FollowGains(height=0.5),
        lost=LostPolicy(hold=2.0),
        area=[(0, 0), (9, 0), (9, 9)],
    ).deploy(edge).analyse(vests)
    eyes = CombinedDetector([OnnxDetector(classes=["tower"]), OnnxDetector(own, classes=["vest"])])
    TowerInspectionAnalytics(
        env, pictures=tmp_path / "anywhere" / "pictures", detector=eyes
    ).deploy(edge).analyse(camera(env))
    pose = BodyPoseEmergencyAnalytics(lands=False).deploy(edge)
    pose.analyse(camera(env))
    pose.trigger(drone.pause_mission, when=hand_raised)
    watch = MonitoringAnalytics(["position"]).deploy(edge)
    watch.analyse(odometry(env))
    watch.trigger(drone.end_mission, when=Near((1.5, 2.0), metres=3.0))
    env.set_trajectory_scheduler(OptimalScheduler(env, objective="energy"))
    env.set_analytics_scheduler("margin")
    fly(env)
    document = write_mission(env, "all")
    fresh = environment()
    assert again(document, fresh, tmp_path / "models") == document
    assert isinstance(fresh.trajectory_scheduler(), OptimalScheduler)
    works = {name: node.work for name, node in fresh.graph.nodes.items()}
    follow = works["drone/follow"]
    assert follow.given_settings()["gains"] == FollowGains(height=0.5)
    assert works["drone/tower_inspection"].folder == Path("runs/pictures")
    finders = works["drone/tower_inspection"].detector.detectors
    assert [one.labels for one in finders] == [("tower",), ("vest",)]
    assert works["drone/vip_detection"].min_score == 0.4
    (trigger,) = works["drone/monitoring"].node.triggers
    assert trigger.when == Near((1.5, 2.0), metres=3.0)
    assert trigger.when(Readings(0, {"position.east": 1.0, "position.north": 2.0}))
    assert not trigger.when(Readings(0, {"position.east": 9.0, "position.north": 2.0}))


class Own(Analytics[Readings]):
    """An analysis of the application."""

    accepts = (Frame,)

    def process(self, item: Frame, context: Context) -> Readings:
        """Nothing."""
        del item
        return Readings(context.now(), {})


def own_class(env: Environment) -> None:
    """Analyses with a class of its own."""
    Own().deploy(env.get_compute_resource_by_id("edge")).analyse(camera(env))
    fly(env)


def own_condition(env: Environment) -> None:
    """Ends by a function of its own."""
    watch = MonitoringAnalytics(["position"]).deploy(env.get_compute_resource_by_id("edge"))
    watch.trigger(env.get_robot_by_id("drone").end_mission, when=lambda _: True)
    watch.analyse(odometry(env))
    fly(env)


def own_file(env: Environment) -> None:
    """Reads a file that only this machine has."""
    path = env.path.parent / "track.csv"
    path.write_text("time,latitude,longitude\n0,1,2\n")
    GpsLoggerAnalytics(path).deploy(env.get_compute_resource_by_id("edge")).instantiate()
    fly(env)


def own_scheduler(env: Environment) -> None:
    """Plans with a class of its own."""

    class Mine(OptimalScheduler):
        pass

    env.set_trajectory_scheduler(Mine(env))
    fly(env)


def own_dispatcher(env: Environment) -> None:
    """Schedules by a class that it names by module."""
    env.set_analytics_scheduler("aerodaas.schedulers.analytics.margin:Margin")
    fly(env)


def packages(env: Environment) -> None:
    """Wants packages of its own."""
    edge = env.get_compute_resource_by_id("edge")
    MonitoringAnalytics().deploy(edge, {"packages": ["torch"]}).analyse(odometry(env))
    fly(env)


def hooks(env: Environment) -> None:
    """Has a function called at the end."""
    env.get_robot_by_id("drone").on_end(lambda: None)
    fly(env)


def callbacks(env: Environment) -> None:
    """Has a function called for each frame."""
    env.get_robot_by_id("drone").get_sensor_by_id("cam").subscribe(lambda _: None)
    fly(env)


def own_address(env: Environment) -> None:
    """Listens where it says itself."""
    RemoteAnalytics(port=8351).deploy(env.get_compute_resource_by_id("edge")).instantiate()
    fly(env)


def whole_environment(env: Environment) -> None:
    """Has the environment's data for a setting."""
    edge = env.get_compute_resource_by_id("edge")
    whole: Any = env.env_data
    MonitoringAnalytics(battery_low=whole).deploy(edge).analyse(odometry(env))
    fly(env)


def velocities(env: Environment) -> None:
    """Flies by velocities that it gives itself."""
    commands = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(0.2)])
    env.get_robot_by_id("drone").navigate(commands)


@pytest.mark.parametrize(
    ("build", "told"),
    [
        (own_class, r"Own is the application's own code.*entry point of `aerodaas\.analytics`"),
        (own_condition, r"MonitoringAnalytics\.trigger\(when=…\): .*<lambda> is code"),
        (own_file, r"GpsLoggerAnalytics\(source=…\) reads .*track\.csv.*get_sensor_property"),
        (own_scheduler, r"Mine is the application's own code"),
        (own_dispatcher, r"margin:Margin is the application's own code"),
        (packages, r"drone/monitoring: a document has no runtime_env"),
        (hooks, r"no hooks of on_start, on_end or start_mission"),
        (callbacks, r"no callbacks of subscribe"),
        (own_address, r"RemoteAnalytics\(port=…\) comes from the environment file alone"),
        (whole_environment, r"MonitoringAnalytics\(battery_low=…\): no document holds the env"),
        (velocities, r"velocity commands in a document come from analyses"),
        (lambda _: None, r"nothing flies"),
    ],
)
def test_what_no_document_can_hold_is_named(
    environment: Callable[[], Environment], build: Callable[[Environment], None], told: str
) -> None:
    """With the remedy, where there is one."""
    env = environment()
    build(env)
    with pytest.raises(GraphError, match=told):
        write_mission(env, "x")


def document_of(**content: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    """A small document with this instead of its own."""
    watch = {
        "id": "drone/monitoring",
        "analysis": "MonitoringAnalytics",
        "reads": ["drone/odom"],
        "compute": "edge",
    }
    return {
        "format": "aerodaas-mission",
        "version": 1,
        "environment": "environment.json",
        "sensors": ["drone/odom", "drone/cam"],
        "analyses": [{**watch, **content.pop("analysis", {})}],
        "navigation": [{"robot": "drone", "waypoints": [{"id": "a", "x": 1, "y": 0, "z": 2}]}],
        **content,
    }


def monitoring(**entry: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    """A document whose only analysis has this."""
    return document_of(analysis=entry)


def detecting(path: object) -> dict[str, Any]:
    """A document whose analysis has a detector of this model."""
    return tower(detector={"$analysis": "OnnxDetector", "settings": {"path": path}})


def tower(**settings: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    """A document whose only analysis has these settings."""
    return document_of(
        analysis={
            "id": "drone/tower_inspection",
            "analysis": "TowerInspectionAnalytics",
            "reads": ["drone/cam"],
            "settings": settings,
        }
    )


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (document_of(version=2), "version"),
        (document_of(format="mission"), "format"),
        (document_of(code="import os"), "code"),
        (document_of(navigation=[]), "navigation"),
        (document_of(sensors=["drone/none"]), "no sensor is called 'drone/none'|none"),
        (monitoring(analysis="os:system"), "analysis"),
        (monitoring(analysis="Analytics"), "Analytics"),
        (monitoring(analysis="Nothing"), "Nothing"),
        (monitoring(reads=["drone/later"]), "drone/later"),
        (monitoring(reads=["drone/cam"], analysis="TrackingAnalytics"), "stream"),
        (monitoring(compute="elsewhere"), "elsewhere"),
        (monitoring(id="drone/other name"), "id"),
        (monitoring(settings={"nothing": 1}), "nothing"),
        (
            monitoring(settings={"battery_low": {"$settings": "Path", "of": {}}}),
            "Path",
        ),
        (
            monitoring(settings={"patience": {"$model": "x", "sha256": "y"}}),
            r"\$model",
        ),
        (
            monitoring(triggers=[{"target": "drone", "command": "navigate"}]),
            "command",
        ),
        (
            monitoring(triggers=[{"target": "nobody", "command": "end_mission"}]),
            "nobody",
        ),
        (monitoring(triggers=[{"target": "drone/x"}]), "drone/x"),
        (document_of(trajectory_scheduler={"name": "nothing"}), "nothing"),
        (document_of(analytics_scheduler="module:Class"), "analytics_scheduler"),
        (document_of(navigation=[{"robot": "other", "stream": "drone/odom"}]), "other"),
        (document_of(navigation=[{"robot": "drone", "stream": "drone/odom"}]), "drone/odom"),
        (document_of(navigation=[{"robot": "drone", "waypoints": [{"id": "a"}]}]), "x"),
        (tower(pictures={"$output": "../../etc"}), "names no file or address"),
        (tower(pictures={"$output": "C:\\x"}), "names no file or address"),
        (tower(pictures="/etc/cron.d"), "names no file or address"),
        (tower(pictures={"$model": "x", "sha256": "0" * 64}), "names no file or address"),
        (
            detecting("/etc/passwd"),
            "names no file",
        ),
        (
            detecting({"$model": "x", "sha256": "0"}),
            "no model 'x' with the SHA-256",
        ),
        (
            monitoring(analysis="RemoteAnalytics", reads=[], settings={"port": 1}),
            "names no file or address",
        ),
        (
            monitoring(
                id="drone/remote",
                analysis="RemoteAnalytics",
                settings={"env_data": {"remote": {"token": "known", "host": "192.0.2.1"}}},
            ),
            "names no file or address",
        ),
        (tower(detector={"$condition": "print"}), r"no \$condition 'print'"),
        (
            # Named in the analysis' error, the whole file would be the document's author's.
            monitoring(settings={"readings": [{"$environment": "data"}]}),
            r"MonitoringAnalytics\.readings: there is no \$environment 'data' here",
        ),
    ],
)
def test_what_cannot_be_flown_here_is_refused(
    environment: Callable[[], Environment], tmp_path: Path, content: dict[str, Any], told: str
) -> None:
    """By the document's own words, before anything starts."""
    path = tmp_path / "mission.json"
    path.write_text(json.dumps(content))
    with pytest.raises(AeroDaaSError, match=told):
        build_mission(read_mission(path), environment(), tmp_path)


_NAMES = st.sampled_from(
    ["drone", "drone/odom", "drone/cam", "drone/monitoring", "edge", "", "x" * 99]
)
_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | _NAMES,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            _NAMES
            | st.sampled_from(
                [
                    "$model",
                    "$output",
                    "$property",
                    "$analysis",
                    "$settings",
                    "$environment",
                    "of",
                    "settings",
                ]
            ),
            inner,
            max_size=3,
        )
    ),
    max_leaves=8,
)


@given(
    field=st.sampled_from(["analyses", "navigation", "sensors", "trajectory_scheduler", "name"]),
    value=_JSON,
    settings=st.dictionaries(
        st.sampled_from(["readings", "battery_low", "max_height", "patience", "self", "x"]), _JSON
    ),
)
def test_no_document_does_more_than_be_refused(
    tmp_path_factory: pytest.TempPathFactory,
    field: str,
    value: object,
    settings: dict[str, Any],
) -> None:
    """Any JSON in any place: it is built, or there is one of the project's errors."""
    folder = tmp_path_factory.getbasetemp() / "documents"
    folder.mkdir(exist_ok=True)
    (folder / "environment.json").write_text(json.dumps(CONTENT))
    current_options.set(RunOptions(view=False))
    for content in (document_of(**{field: value}), monitoring(settings=settings)):
        (folder / "mission.json").write_text(json.dumps(content))
        with contextlib.suppress(AeroDaaSError):
            document = read_mission(folder / "mission.json")
            build_mission(document, Environment(folder / "environment.json"), folder)


def test_a_document_is_flown_in_an_environment_that_lies_beside_it(tmp_path: Path) -> None:
    """Never in one that it chooses by a path; --env tells another."""
    path = tmp_path / "mission.json"
    for name in ("/etc/environment.json", "../environment.json", "", "none.json"):
        path.write_text(json.dumps(document_of(environment=name)))
        with pytest.raises(ConfigError, match=re.escape("give the file of yours by --env")):
            fly_mission(path, RunOptions(view=False))


def test_an_application_that_goes_on_in_flight_is_no_mission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it does there is code of its own; nothing flies to find out."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "env.json").write_text(json.dumps({**FLAT, "robots": [robot()]}))
    text = """
from aerodaas import *
env = Environment("env.json")
drone = env.get_robot_by_id("drone")
drone.navigate(AeroListData([Waypoint("a", 2, 0, 2)]))
drone.start_mission(wait=False)
drone.wait()
"""
    (tmp_path / "app.py").write_text(text)
    assert compile_application(tmp_path / "app.py", []).navigation
    (tmp_path / "app.py").write_text(text.replace("drone.wait()", "drone.pause_mission()"))
    with pytest.raises(GraphError, match=r"app\.py cannot be written.*only `aerodaas run` flies"):
        compile_application(tmp_path / "app.py", [])
    assert not (tmp_path / "runs").exists()


def test_an_application_that_never_starts_is_no_mission(tmp_path: Path) -> None:
    """Nor one that is not there."""
    (tmp_path / "app.py").write_text("print('nothing')")
    with pytest.raises(GraphError, match=r"app\.py cannot be written .*never called start_mission"):
        compile_application(tmp_path / "app.py", [])
    with pytest.raises(ConfigError, match="there is no application"):
        compile_application(tmp_path / "none.py", [])
