"""Names of the project's own can be taken for nobody else's, in streams and in recordings."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from flying import FLAT, Flyer, recorded, robot
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, TypeAdapter, ValidationError

from aerodaas import AeroNavigation, Analytics, Environment, Waypoint
from aerodaas.analytics.base import Context
from aerodaas.config.model import validated
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.errors import ConfigError, GraphError
from aerodaas.identifiers import INTERNAL, ScopedWord, Word, is_internal, require_name
from aerodaas.protocol.schemas import AccountIn, GrantIn, MissionIn
from aerodaas.recording.encoding import stream_of, topic
from aerodaas.runtime import stream_names as _names
from aerodaas.runtime.plan import make_plan
from aerodaas.runtime.session import Session

OWN = ["state", "status", "setpoints", "fence", "commands", "requests", "replies", "tasks", "done"]
NAMERS = [
    _names.state_stream,
    _names.status_stream,
    _names.setpoint_stream,
    _names.end_stream,
    _names.task_stream,
    _names.done_stream,
]
ids = st.sampled_from(OWN) | st.from_regex(r"[A-Za-z][A-Za-z0-9_\-]{0,8}", fullmatch=True)
streams = st.builds("{}/{}".format, ids, ids)


class Anything(Analytics[float]):
    """Says how heavy a reading is."""

    produces = float

    def __init__(self, name: str) -> None:
        """Be called `name`."""
        self.name = name

    def process(self, item: Any, context: Context) -> float:  # noqa: ARG002, ANN401
        """Nothing flies."""
        return 0.0


@pytest.mark.parametrize("name", [f"a{INTERNAL}b", "a/b", "", " ", "a b", "9", "a>b"])
def test_names_that_could_be_taken_for_others_are_refused(name: str, tmp_path: Path) -> None:
    """As an analysis' name and as an id."""
    with pytest.raises(GraphError, match="cannot be called"):
        require_name(name, "Anything")
    with pytest.raises(ConfigError, match="id"):
        validated({"robots": [{"id": "drone", "sensors": [{"id": name}]}]}, "here")
    if name:
        env = Environment(Flyer(tmp_path).write({**FLAT, "robots": [robot(sensors=[STATE])]}))
        data = env.get_robot_by_id("drone").get_sensor_by_id("state").get_data_stream()
        with pytest.raises(GraphError, match="cannot be called"):
            Anything(name).analyse(data)


@given(streams, ids)
def test_no_id_makes_an_internal_stream(stream: str, node: str) -> None:
    """What is built from ids is told apart from what the project builds itself."""
    assert not is_internal(stream)
    assert all(is_internal(namer(stream)) and is_internal(namer(node)) for namer in NAMERS)


@given(streams, st.sampled_from(["state", "status", "setpoints", "fence"]))
def test_no_two_share_a_topic(stream: str, own: str) -> None:
    """No sensor's or analysis' topic is one of the project's, which keep their plain names."""
    owner = stream.partition("/")[0]
    ours = topic(f"{owner}/{INTERNAL}{own}", "odometry")
    assert ours == f"/{owner}/{own}/odometry"
    assert topic(stream, "odometry") != ours


@given(streams)
def test_a_topic_tells_its_stream(stream: str) -> None:
    """What a replay takes for the stream's name is the name."""
    assert stream_of(topic(stream, "x y z").removesuffix("/x y z")) == stream


STATE = {"id": "state", "type": "status", "rate": 5}
SENSORS: list[dict[str, Any]] = [
    STATE,
    {"id": "status", "type": "odometry", "rate": 5},
    {"id": "setpoints", "type": "battery", "rate": 5},
]


def test_a_plan_names_each_stream_once(tmp_path: Path) -> None:
    """Sensors and analyses called as the project's own streams have streams of their own."""
    env = Environment(Flyer(tmp_path).write({**FLAT, "robots": [robot(sensors=SENSORS)]}))
    drone = env.get_robot_by_id("drone")
    for name in OWN:
        Anything(name).analyse(drone.get_sensor_by_id("state").get_data_stream())
    drone.navigate(AeroNavigation(data=[Waypoint("a", 1, 0, 2)]))
    made = make_plan(
        Session(env.config, None), env.graph, env.compute(), env.trajectory_scheduler()
    )
    spec = made.drones[0][0]
    published = [f"drone/{sensor.id}" for sensor in spec.sensors]
    published += [spec.stream for spec in made.analyses]
    published += [_names.state_stream("drone"), _names.status_stream("drone")]
    published += [_names.setpoint_stream("drone"), _names.end_stream("drone")]
    assert len(published) == len(set(published))


def test_sensors_called_like_ours_fly(flyer: Flyer) -> None:
    """The very ids of the documented environment file; each is recorded on topics of its own."""

    def application(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        drone.navigate(AeroNavigation(data=[Waypoint("a", 2, 0, 2)]))

    run = flyer.fly(application, {**FLAT, "robots": [robot(sensors=SENSORS)]})
    flight = recorded(run)
    assert flight.robots["drone"].visited == ("a",)


WORD, SCOPED_WORD = TypeAdapter(Word), TypeAdapter(ScopedWord)
_PART = r"[^\W\d][\w\-]{0,63}"
parts = st.from_regex(r"[a-zà_0-9\-]{0,3}", fullmatch=True)
lengths = st.sampled_from([0, 1, 60, 61, 64])
texts = st.builds(lambda part, more: part + "x" * more, parts, lengths)


def _takes(adapter: TypeAdapter[str], text: str) -> bool:
    try:
        return adapter.validate_python(text) == text
    except ValidationError:
        return False


@given(texts, texts)
def test_a_name_of_a_document_has_at_most_64_characters_a_letter_first(a: str, b: str) -> None:
    """So has each of the two parts of a scoped one, and it has no third."""
    assert _takes(WORD, a) == bool(re.fullmatch(_PART, a))
    for text in (a, f"{a}/{b}", f"{a}/{b}/{a}", f"{a}\n"):
        assert _takes(SCOPED_WORD, text) == bool(re.fullmatch(rf"{_PART}(/{_PART})?", text))


@pytest.mark.parametrize("model", [MissionDocument, MissionIn, GrantIn, AccountIn])
def test_no_pattern_of_a_document_counts_letters_of_all_scripts(model: type[BaseModel]) -> None:
    """Each that does takes megabytes of every process that imports the model."""
    text = str(model.model_json_schema())
    assert "pattern" in text
    assert "]{0," not in text
