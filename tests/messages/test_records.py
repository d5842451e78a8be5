"""Records are equal by what they hold, hash alike if they are, and survive pickling."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from aerodaas import (
    AeroNavigation,
    Alert,
    Battery,
    Detection,
    Detections,
    Frame,
    GpsFix,
    Odometry,
    VelocityCommand,
    Waypoint,
)
from aerodaas.cameras.base import Picture
from aerodaas.geometry.energy import EnergyModel
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision, MissionState, MissionStatus, SetpointRecord
from aerodaas.messages.readings import Readings
from aerodaas.messages.serialization.records import fast_pickle
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.schedulers.trajectory.base import PlanningContext

HEADER = Header(3, 40, "drone/cam")
ODOMETRY = Odometry(np.array([1.0, 2.0, 3.0]), np.zeros(3), 0.5)
CAMERA = CameraModel(64, 36, 50.0, 50.0, 32.0, 18.0)
POINTS = np.ones((17, 3), np.float32)
DETECTION = Detection((1.0, 2.0, 3.0, 4.0), "person", 0.9, keypoints=POINTS)
PIXELS = np.full((4, 6, 3), 7, np.uint8)
DEPTH = np.full((4, 6), 900, np.uint16)
SETPOINT = VelocitySetpoint(np.array([1.0, 0.0, 0.0]), 0.1)
RECORDS: list[Any] = [
    ODOMETRY,
    GpsFix(12.9, 77.5, 900.0),
    Battery(0.5),
    Frame(HEADER, PIXELS, CAMERA, ODOMETRY, DEPTH),
    DETECTION,
    Detections(HEADER, (DETECTION,), 64, 36, CAMERA, ODOMETRY, DEPTH),
    Alert(HEADER, "battery_low", "The battery is low.", {"charge": 0.1, "at": [1.0, 2.0]}),
    Readings(5, {"height": 2.0}),
    PositionSetpoint(np.zeros(3)),
    SETPOINT,
    VehicleState(1, ODOMETRY, Battery(1.0), VehicleMode.GROUNDED, armed=False),
    SetpointRecord(1, SETPOINT, SETPOINT, ("fence",)),
    Decision(1, "t", "edge", "", {"slack": 0.1}),
    MissionStatus(1, MissionState.ENROUTE),
    Waypoint("a", 1.0, 2.0, 3.0),
    VelocityCommand(1.0),
    PlanningContext(0.0, np.zeros(3), np.ones(3), energy=EnergyModel()),
    EnergyModel(900.0, np.ones(3)),
    Picture(PIXELS, 4, "a.jpg", ODOMETRY, DEPTH),
]


def copied(record: Any) -> Any:  # noqa: ANN401
    """The record as another process would get it."""
    return pickle.loads(pickle.dumps(record))  # noqa: S301 - our own bytes


def altered(value: object) -> object:
    """Something of the same kind that differs; None where nobody knows what."""
    if isinstance(value, np.ndarray):
        return value + 1
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    return {**value, "more": 1.0} if isinstance(value, dict) else None


@pytest.mark.parametrize("record", RECORDS, ids=lambda one: type(one).__name__)
def test_a_copy_is_equal_and_a_change_is_not(record: Any) -> None:  # noqa: ANN401
    """Every record with arrays or figures in it, field by field."""
    copy = copied(record)
    assert copy is not record
    assert copy == record
    assert hash(copy) == hash(record)
    assert len({copy, record}) == 1
    assert record != "something else"
    for field in fields(record):
        other = altered(getattr(record, field.name))
        if other is not None and field.init:
            assert replace(record, **{field.name: other}) != record


@fast_pickle
@dataclass(frozen=True, slots=True)
class Anything:
    """Holds one value."""

    value: Any


numbers = st.floats() | st.integers(-(2**40), 2**40)
any_array = arrays.arrays(
    st.sampled_from([np.float64, np.float32, np.int64, np.uint8, np.bool_]),
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
)
values = st.recursive(
    st.none() | st.booleans() | numbers | st.text(max_size=3) | any_array,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text(max_size=2), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(values)
def test_whatever_it_holds_a_copy_is_the_same(value: object) -> None:
    """Nested, empty, without numbers, NaN: equal, and of one hash."""
    record = Anything(value)
    copy = copied(record)
    assert copy == record
    assert hash(copy) == hash(record)


@given(values, values)
def test_equality_is_mutual_and_agrees_with_the_hash(one: object, other: object) -> None:
    """What is equal hashes alike, whichever is asked."""
    first, second = Anything(one), Anything(other)
    assert (first == second) == (second == first)
    assert first != second or hash(first) == hash(second)


@given(any_array)
def test_the_type_of_numbers_does_not_matter(array: Any) -> None:  # noqa: ANN401
    """An odometry of whole numbers is that of the same floats."""
    same = Anything(array.astype(np.float64))
    assert same == Anything(array)
    assert hash(same) == hash(Anything(array))


def test_an_array_is_not_its_list() -> None:
    """Shapes and kinds are told apart."""
    assert Anything(np.zeros(3)) != Anything([0.0, 0.0, 0.0])
    assert Anything(np.zeros(3)) != Anything(np.zeros((3, 1)))
    assert Anything((1,)) != Anything([1])
    assert Anything({"a": np.zeros(2)}) == Anything({"a": np.zeros(2)})


def test_navigation_of_equal_waypoints_is_found() -> None:
    """`in` and `index` work on lists of records with arrays."""
    history = [Odometry(np.full(3, float(i)), np.zeros(3), 0.0) for i in range(4)]
    assert history.index(Odometry(np.full(3, 2.0), np.zeros(3), 0.0)) == 2
    assert Waypoint("a", 1, 2, 3) in AeroNavigation(data=[Waypoint("a", 1.0, 2.0, 3.0)])


def test_equal_waypoints_are_unpickled_as_one() -> None:
    """A status that comes 20 times a second builds none of its waypoints anew."""
    here = Waypoint("here", 1.0, 2.0, 3.0)
    assert copied(here) is copied(here)
    assert copied(replace(here, priority=1)).priority == 1
    whole = replace(here, x=1)
    assert type(copied(whole).x) is type(whole.x)


def test_a_derived_waypoint_keeps_its_class() -> None:
    """And what it holds beside."""
    found = copied(_Marked("here", 1.0, 2.0, 3.0, mark="x"))
    assert type(found) is _Marked
    assert found.mark == "x"


@dataclass(frozen=True)
class _Marked(Waypoint):
    """A waypoint of a person's own class."""

    mark: str = ""
