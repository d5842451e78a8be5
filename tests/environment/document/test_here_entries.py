"""Places in a document for code at the user's side: written, read, and filled from there."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, get_args

import numpy as np
import pytest
from flying import FLAT, hop

from aerodaas import Analytics, Environment, Odometry
from aerodaas.analytics import (
    BodyPoseEmergencyAnalytics,
    MonitoringAnalytics,
    Near,
    RemoteAnalytics,
)
from aerodaas.analytics.base import Context
from aerodaas.analytics.here.analysis import HereAnalysis, HereConditions, HereSite
from aerodaas.analytics.wire_items import pack, unpack
from aerodaas.config.options import RunOptions, current_options
from aerodaas.dataflow.mission_document import (
    HERE_ITEMS,
    HereItem,
    MissionDocument,
    read_mission,
)
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.document.compiling import write_mission
from aerodaas.environment.provider.here import HereServer
from aerodaas.errors import AeroDaaSError, GraphError
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.readings import Alert, Readings

CONTENT: dict[str, Any] = {
    **FLAT,
    "robots": [
        {
            "id": "drone",
            "sensors": [{"id": "odom", "type": "odometry"}, {"id": "cam", "type": "camera"}],
        }
    ],
}
SITE = HereSite(Path("here.sock"))


class Height(Analytics[float]):
    """The height, in halves; one that is too low is an alert, and one below ground an error."""

    accepts = (Odometry,)

    def __init__(self) -> None:
        self.seen: list[float] = []

    def process(self, item: Odometry, context: Context) -> float:
        """Half of the height."""
        self.seen.append(item.height)
        if item.height < 0:
            raise ValueError("below ground")
        if item.height < 1:
            figures = {"up": item.height, "of": np.float32(1), "far": math.inf, "at": ("a", 1)}
            context.alert(Alert(Header(0, context.now(), "height"), "low", "too low", figures))
        return item.height / 2


class Mark:
    """A class of this file's own."""

    def __init__(self, height: float) -> None:
        self.height = height


class Marks(Analytics[Mark]):
    """Marks of heights."""

    accepts: ClassVar[tuple[type, ...]] = (Odometry,)

    def process(self, item: Odometry, context: Context) -> Mark:
        """A mark of the height."""
        del context
        return Mark(item.height)


class Reader(Analytics[str]):
    """Reads marks."""

    accepts = (Mark,)

    def process(self, item: Mark, context: Context) -> str:
        """What the mark says, many times over at great heights."""
        del context
        return str(item.height) * (500_000 if item.height > 100 else 1)


class Blur(Analytics[Frame]):
    """Produces pictures."""

    def process(self, item: Frame, context: Context) -> Frame:
        """The same picture."""
        del context
        return item


@pytest.fixture
def environment(tmp_path: Path) -> Callable[[], Environment]:
    """Makes fresh environments of one file."""
    (tmp_path / "environment.json").write_text(json.dumps(CONTENT))

    def make() -> Environment:
        current_options.set(RunOptions(view=False))
        return Environment(tmp_path / "environment.json")

    return make


def odometry(env: Environment) -> Any:  # noqa: ANN401 - a stream
    """The drone's odometry."""
    return env.get_robot_by_id("drone").get_sensor_by_id("odom").get_data_stream()


def camera(env: Environment) -> Any:  # noqa: ANN401 - a stream
    """The drone's camera."""
    return env.get_robot_by_id("drone").get_sensor_by_id("cam").get_data_stream()


def fly(env: Environment) -> None:
    """Navigate, so that there is a mission."""
    env.get_robot_by_id("drone").navigate(hop((3, 0)))


def everything(env: Environment) -> None:
    """Analyses on either side, and conditions of each kind on each."""
    drone = env.get_robot_by_id("drone")
    height = Height().deploy(env.here)
    height.analyse(odometry(env))
    height.trigger(drone.pause_mission, when=lambda half: half > 1)
    height.trigger(drone.resume_mission)
    Reader().analyse(Marks().analyse(odometry(env)))
    watch = MonitoringAnalytics(["position", "height"])
    watch.deploy(env.get_compute_resource_by_id("edge")).analyse(odometry(env))
    watch.trigger(drone.end_mission, when=Near((9, 9), metres=1))
    watch.trigger(drone.end_mission, when=lambda seen: seen.values["height"] > 3)
    fly(env)


def submitted(env: Environment) -> MissionDocument:
    """The document as it arrives at a provider."""
    document = write_mission(env, "x", here=True)
    return MissionDocument.model_validate_json(document.text())


def test_what_is_code_has_a_place(environment: Callable[[], Environment]) -> None:
    """Analyses by what they read and produce, conditions by their numbers."""
    env = environment()
    everything(env)
    document = submitted(env)
    height, marks, reader, watch = document.analyses
    assert (height.id, height.reads, height.analysis) == ("drone/height", ["drone/odom"], None)
    assert [one.here and one.here.produces for one in document.analyses] == [
        *("float", "object", "str"),
        None,
    ]
    assert [one.when for one in height.triggers] == [{"$here": 0}, None]
    assert watch.analysis == "MonitoringAnalytics"
    assert watch.triggers[1].when == {"$here": 1}
    assert reader.reads == [marks.id]
    assert document.here == [height.id, marks.id, reader.id, watch.id]
    assert "Height" not in document.text()


def test_the_provider_builds_stand_ins(
    environment: Callable[[], Environment], tmp_path: Path
) -> None:
    """With the types of the results, and the conditions by way of a stand-in of their own."""
    env = environment()
    everything(env)
    document = submitted(env)
    theirs = environment()
    build_mission(document, theirs, tmp_path, SITE)
    nodes = theirs.graph.nodes
    works = {name: type(node.work) for name, node in nodes.items() if node.kind != "sensor"}
    assert works == {
        "drone/height": HereAnalysis,
        "drone/marks": HereAnalysis,
        "drone/reader": HereAnalysis,
        "drone/monitoring": MonitoringAnalytics,
        "drone/monitoring_conditions": HereConditions,
    }
    assert nodes["drone/height"].item is float
    assert nodes["drone/monitoring_conditions"].inputs == ["drone/monitoring"]
    assert [one.method for one in nodes["drone/monitoring"].triggers] == ["end_mission"]
    assert nodes["drone/monitoring"].triggers[0].when == Near((9, 9), metres=1)
    assert len(nodes["drone/monitoring_conditions"].triggers) == 1
    assert all(nodes[name].compute is None for name in document.here[:3])


def test_parts_of_an_analysis_stay_with_it(environment: Callable[[], Environment]) -> None:
    """One that has started another for itself has both at the user's side."""
    env = environment()
    BodyPoseEmergencyAnalytics().deploy(env.here).analyse(camera(env))
    fly(env)
    inner, outer = write_mission(env, "x").analyses
    assert inner.here is not None
    assert outer.here is not None
    assert inner.reads == ["drone/cam"]
    assert inner.id in outer.reads


def test_the_users_side_is_the_edge_in_a_flight_of_ones_own(
    environment: Callable[[], Environment],
) -> None:
    """As for an analysis that is not deployed; a source of its own runs, too."""
    env = environment()
    assert env.here.get_compute_properties() == {"id": "here"}
    stream = MonitoringAnalytics().deploy(env.here).instantiate()
    assert env.graph.nodes[stream.name].compute is None


def elsewhere(env: Environment) -> None:
    """Wants code of its own on the edge."""
    Height().deploy(env.get_compute_resource_by_id("edge")).analyse(odometry(env))


def commanding(env: Environment) -> None:
    """Wants to command from the user's side."""
    RemoteAnalytics().deploy(env.here).instantiate()


def pictures(env: Environment) -> None:
    """Wants pictures to go back."""
    Blur().analyse(camera(env))


def packages(env: Environment) -> None:
    """Wants packages of its own at its own side."""
    Height().deploy(env.here, {"packages": ["torch"]}).analyse(odometry(env))


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (elsewhere, r"Height is the application's own code.*deploy\(env\.here\).*entry point"),
        (commanding, "remote commands the drone, and cannot stay"),
        (pictures, "drone/blur produces pictures"),
        (packages, "drone/height: a document has no runtime_env"),
    ],
)
def test_what_cannot_be_at_the_users_side_is_refused(
    environment: Callable[[], Environment], build: Callable[[Environment], None], said: str
) -> None:
    """With the class or the name, and the ways out."""
    env = environment()
    build(env)
    fly(env)
    with pytest.raises(GraphError, match=said):
        write_mission(env, "x", here=True)


def test_without_a_user_its_places_stay_empty(
    environment: Callable[[], Environment], tmp_path: Path
) -> None:
    """So the document is refused, by the names of what needs the user."""
    env = environment()
    everything(env)
    with pytest.raises(GraphError, match=r"drone/height, .*drone/monitoring: code"):
        build_mission(submitted(env), environment(), tmp_path)


def here(**words: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    """A document whose only analysis is at the user's side, changed by `words`."""
    entry = {"id": "drone/a", "here": {"produces": "Readings"}, "reads": ["drone/odom"]}
    return {
        "format": "aerodaas-mission",
        "version": 1,
        "sensors": ["drone/odom"],
        "analyses": [{**entry, **words}],
        "navigation": [{"robot": "drone", "waypoints": [{"id": "a", "x": 1, "y": 0, "z": 2}]}],
    }


def ends(when: object) -> dict[str, Any]:
    """A trigger with this condition."""
    return {"target": "drone", "command": "end_mission", "when": when}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (here(analysis="MonitoringAnalytics"), "either `analysis`"),
        (here(here=None), "either `analysis`"),
        (here(settings={"readings": []}), "no settings, compute or task"),
        (here(compute="edge"), "no settings, compute or task"),
        (here(task={"benefit": 1}), "no settings, compute or task"),
        (here(here={"produces": "os.system"}), "produces"),
        (here(here={"produces": "Frame"}), "produces"),
        (here(here={"produces": "float", "module": "os"}), "module"),
        (here(triggers=[ends({"$here": 1})]), "trigger 0 at the user's side"),
        (here(triggers=[ends({"$here": "os.system"})]), "trigger 0 at the user's side"),
        (here(triggers=[ends({"$here": 0, "x": 1})]), "trigger 0 at the user's side"),
        (
            here(analysis="MonitoringAnalytics", here=None, settings={"patience": {"$here": 0}}),
            r"there is no \$here",
        ),
        (here(reads=["drone/none"]), "drone/none"),
        (here(reads=[], rate=0), "rate"),
        (
            {**here(), "navigation": [{"robot": "drone", "stream": "drone/a"}]},
            "cannot navigate by drone/a",
        ),
    ],
)
def test_a_malformed_place_is_refused(
    environment: Callable[[], Environment], tmp_path: Path, content: dict[str, Any], said: str
) -> None:
    """By the document's own words."""
    path = tmp_path / "mission.json"
    path.write_text(json.dumps(content))
    with pytest.raises(AeroDaaSError, match=said):
        build_mission(read_mission(path), environment(), tmp_path, SITE)


def test_each_type_has_a_name() -> None:
    """The schema and the classes say the same."""
    assert set(get_args(HereItem)) == set(HERE_ITEMS)


@pytest.fixture
def application(environment: Callable[[], Environment]) -> Environment:
    """An application with analyses of its own."""
    env = environment()
    everything(env)
    return env


@pytest.fixture
def server(application: Environment) -> HereServer:
    """The user's side of that application."""
    made = HereServer(application, submitted(application))
    made.open()
    return made


def at(height: float) -> Odometry:
    """Odometry at this height."""
    return Odometry(np.array([0.0, 0.0, height]), np.zeros(3), 0.0)


def question(key: str, item: object, **words: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    """A question as a relay sends it."""
    content, _ = pack(item)
    base = {"do": "process", "key": key, "now": 5, "on": "edge", "vehicle": None, "number": 3}
    return {**base, "item": content, **words}


def test_the_users_side_answers(server: HereServer, application: Environment) -> None:
    """By a copy of the application's analysis; with its alerts and the conditions that are met."""
    answer, blob = server.answer(question("drone/height", at(0.5)), b"")
    assert answer.pop("took") > 0
    figures = {"up": 0.5, "of": 1.0, "far": "inf", "at": "('a', 1)"}
    alerts = [{"text": "low: too low", "values": figures}]
    assert answer == {"item": 0.25, "fired": [], "alerts": alerts, "number": 3}
    assert blob == b""
    answer, _ = server.answer(question("drone/height", at(3.0)), b"")
    assert answer["fired"] == [0]
    assert application.graph.nodes["drone/height"].work.seen == []


def test_conditions_of_others_are_answered(server: HereServer) -> None:
    """Those that are code, and no others."""
    for height, fired in ((2.0, []), (4.0, [1])):
        result = Readings(1, {"height": height, "east": 9.0, "north": 9.0})
        answer, _ = server.answer(question("drone/monitoring", result, do="met"), b"")
        assert answer["fired"] == fired


def test_an_item_of_its_own_class_leaves_by_a_number(server: HereServer) -> None:
    """And comes back as the same object; one that is forgotten is an error."""
    answer, _ = server.answer(question("drone/marks", at(2.5)), b"")
    hidden = unpack(answer["item"])
    assert hidden.kind == "Mark"
    assert len(hidden.data) == 8
    answer, _ = server.answer(question("drone/reader", hidden), b"")
    assert answer["item"] == "2.5"
    for _ in range(1000):
        server.answer(question("drone/marks", at(1.0)), b"")
    answer, _ = server.answer(question("drone/reader", hidden), b"")
    assert "a Mark that is no longer kept here" in answer["failed"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (question("drone/height", at(-1.0)), "ValueError: below ground"),
        (question("drone/none", 1), "no analysis 'drone/none' here"),
        ({**question("drone/height", None), "item": {"is": "os.system"}}, "no class 'os.system'"),
        (question("drone/height", at(1.0), vehicle=5), "vehicle's state"),
        (question("drone/height", at(1.0), now="x"), "or its time"),
        ({"number": 3}, "no analysis"),
    ],
)
def test_a_question_that_fails_is_answered(
    server: HereServer, asked: dict[str, Any], said: str
) -> None:
    """By one line, whoever is at fault."""
    answer, _ = server.answer(asked, b"")
    assert said in answer["failed"]
    assert answer["number"] == 3


def test_an_answer_that_is_too_large_is_told(server: HereServer) -> None:
    """The relay would refuse it."""
    mark, _ = server.answer(question("drone/marks", at(1000.0)), b"")
    answer, _ = server.answer(question("drone/reader", unpack(mark["item"])), b"")
    assert "the most are 1048576" in answer["failed"]
