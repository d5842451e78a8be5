"""The JSON of messages: each field comes back, and what is malformed is refused by its name."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest
from filled import filled
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import (
    BatteryOutlook,
    Decision,
    MissionStatus,
    RobotStatus,
    SetpointRecord,
)
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.payload import GimbalAttitude, Photo
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.serialization.schema import MessageError, json_of, message_of
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    Traffic,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.messages.vitals import Vitals
from aerodaas.messages.waypoints import FollowedTarget, VelocityCommand, Waypoint

MESSAGES = (
    *(Alert, Battery, BatteryOutlook, CameraModel, Decision, Detection, Detections),
    *(FollowedTarget, GimbalAttitude, GpsFix, Header, MissionStatus, Odometry, Photo),
    *(PositionSetpoint, Readings, SetpointRecord, Traffic, VehicleState, VelocityCommand),
    *(VelocitySetpoint, Vitals, Waypoint),
)


def through_text(message: object) -> Any:  # noqa: ANN401 - JSON
    """The JSON value of a message, as a strict reader has it."""
    return json.loads(json.dumps(json_of(message), allow_nan=False))


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_each_field_comes_back(kind: type) -> None:
    """A field that is added to a message needs no other line."""
    message = filled(kind)
    if kind is VehicleState:
        message = dataclasses.replace(message, video="")
    assert message_of(kind, through_text(message)) == message


def test_a_secret_field_is_not_written() -> None:
    """The address of a vehicle's video may hold a password."""
    state = filled(VehicleState, video="rtsp://me:word@camera")
    assert "video" not in json_of(state)
    assert "video" not in json_of(filled(RobotStatus, vehicle=state))["vehicle"]


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_an_unknown_field_is_refused_by_name_or_left_out(kind: type) -> None:
    """A stranger's is refused; one that a later version has written is left out."""
    message = filled(kind)
    value = {**through_text(message), "later": 1}
    with pytest.raises(MessageError, match="later"):
        message_of(kind, value)
    known = message_of(kind, value, unknown_fields="ignore")
    assert json_of(known) == json_of(message)


def test_a_number_that_is_none_is_null_and_a_vector_has_axes() -> None:
    """As recordings and pages read it."""
    odometry = Odometry(np.array([1.0, math.nan, 3.0]), np.zeros(3), math.nan)
    value = through_text(odometry)
    assert (value["position"], value["yaw"]) == ({"x": 1.0, "y": None, "z": 3.0}, None)
    assert message_of(Odometry, value) == odometry


def test_numbers_of_numpy_are_written_as_numbers() -> None:
    """Analyses compute with them."""
    readings = Readings(np.int64(5), {"count": np.float32(0.5)})  # type: ignore[arg-type, dict-item]
    assert through_text(readings) == {"stamp": 5, "values": {"count": 0.5}}


@pytest.mark.parametrize(
    ("kind", "change", "said"),
    [
        (Header, {"stamp": 1.5}, "Header"),
        (Header, {"stamp": 2**63}, "Header"),
        (Header, {"id": True}, "Header"),
        (VehicleState, {"mode": "upside_down"}, r"VehicleState\.mode"),
        (VehicleState, {"armed": 1}, r"VehicleState\.armed"),
        (Waypoint, {"x": None}, r"Waypoint\.x"),
        (Waypoint, {"x": "1"}, r"Waypoint\.x"),
        (Waypoint, {"hover_duration": -1.0}, "hover_duration"),
        (Detection, {"keypoints": [[1.0, 2.0]]}, r"Detection\.keypoints"),
        (Detection, {"appearance": "not Base64"}, r"Detection\.appearance"),
        (Detections, {"nearest": [[1], [1, 2]]}, r"Detections\.nearest"),
        (Detections, {"nearest": [[70000]]}, r"Detections\.nearest"),
        (Detections, {"items": [{}]}, r"Detections\.items\.0"),
        (Odometry, {"position": [1.0, 2.0, 3.0]}, r"Odometry\.position"),
    ],
)
def test_a_malformed_field_is_refused_by_its_name(
    kind: type, change: dict[str, Any], said: str
) -> None:
    """What is of another type is never converted."""
    with pytest.raises(MessageError, match=said):
        message_of(kind, {**through_text(filled(kind)), **change})


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(st.sampled_from(MESSAGES), st.data())
def test_any_value_is_read_or_refused(kind: type, data: st.DataObject) -> None:
    """Nothing else comes out of a stranger's JSON, wherever it is changed."""
    value = through_text(filled(kind))
    for name in data.draw(st.sets(st.sampled_from(sorted(value)), max_size=3)):
        value[name] = data.draw(json_values)
    try:
        message = message_of(kind, value)
    except MessageError:
        return
    assert isinstance(message, kind)


def test_a_state_of_few_words_is_read() -> None:
    """What an older version has not written has its default."""
    full = VehicleState(
        1, Odometry(np.zeros(3), np.zeros(3), 0.0), Battery(1.0), VehicleMode.LOST, armed=False
    )
    value = {name: one for name, one in through_text(full).items() if one not in (None, [], {})}
    assert message_of(VehicleState, value) == full
