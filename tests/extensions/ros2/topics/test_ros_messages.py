"""Messages on the wire: byte for byte those of rosbags, which is written by others."""

# ruff: noqa: ANN401 - types that both libraries make as they go

from __future__ import annotations

import dataclasses
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys.store import Typestore

from aerodaas.extensions.ros2.bags.typestore import ros_types
from aerodaas.extensions.ros2.topics import messages as ros
from aerodaas.extensions.ros2.topics.names import ros_type

STORE: Typestore = ros_types()
TYPES = [getattr(ros, name) for name in ros.__all__]
_NUMBERS = {
    "bool": st.booleans(),
    "float32": st.floats(width=32),
    "float64": st.floats(),
    "int8": st.integers(-(2**7), 2**7 - 1),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint8": st.integers(0, 2**8 - 1),
    "uint16": st.integers(0, 2**16 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "string": st.text(
        st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9
    ),
}


def name_of(kind: Any) -> str:
    """ROS 2's name of one of our types."""
    return ros_type(kind.__idl_typename__)


def theirs(kind: Any) -> st.SearchStrategy[Any]:
    """Messages of rosbags, by the definition that it brings."""
    name = name_of(kind)
    made = STORE.types[name]
    _, fields = STORE.fielddefs[name]
    drawn = {field: _values(definition) for field, definition in fields}
    return st.builds(made, **drawn)


def _values(definition: Any) -> st.SearchStrategy[Any]:
    kind, detail = definition
    if kind.name == "BASE":
        return _NUMBERS[detail[0]]
    if kind.name == "NAME":
        return theirs(next(one for one in TYPES if name_of(one) == detail))
    element, length = detail
    if element[0].name == "NAME":
        return st.lists(_values(element), max_size=2)
    least, most = (length, length) if kind.name == "ARRAY" else (0, 5)
    numbers = st.lists(_NUMBERS[element[1][0]], min_size=least, max_size=most)
    return numbers.map(lambda found: np.array(found, np.dtype(element[1][0])))


def ours(message: Any, kind: Any) -> Any:
    """The same message as one of our types, field by field of our own definition."""
    found = {}
    for field in dataclasses.fields(kind):
        value = getattr(message, field.name)
        found[field.name] = _value(value)
    return kind(**found)


def _value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.dtype == np.uint8 else value.tolist()
    if isinstance(value, list):
        return [_value(one) for one in value]
    if hasattr(value, "__msgtype__"):
        return ours(value, next(one for one in TYPES if name_of(one) == value.__msgtype__))
    return value


@pytest.mark.parametrize("kind", TYPES, ids=lambda kind: kind.__name__)
def test_a_type_has_the_fields_of_its_definition(kind: Any) -> None:
    """By name and order."""
    _, fields = STORE.fielddefs[name_of(kind)]
    assert [one.name for one in dataclasses.fields(kind)] == [name for name, _ in fields]


@pytest.mark.parametrize("kind", TYPES, ids=lambda kind: kind.__name__)
@settings(max_examples=20)
@given(data=st.data())
def test_bytes_are_those_of_another_library(kind: Any, data: st.DataObject) -> None:
    """Both ways: what they encode we decode to the same, and what we encode they decode."""
    message = data.draw(theirs(kind))
    name = name_of(kind)
    encoded = bytes(STORE.serialize_cdr(message, name))
    mine = ours(message, kind)
    assert _unpadded(mine.serialize()) == _unpadded(encoded)
    assert _unpadded(kind.deserialize(encoded).serialize()) == _unpadded(encoded)
    back = STORE.serialize_cdr(
        STORE.deserialize_cdr(mine.serialize(), name_of(kind)), name_of(kind)
    )
    assert bytes(back) == encoded
    big = bytes(STORE.serialize_cdr(message, name_of(kind), little_endian=False))
    assert _unpadded(kind.deserialize(big).serialize()) == _unpadded(encoded)


def _unpadded(encoded: bytes) -> bytes:
    return encoded.ljust(-(-len(encoded) // 4) * 4, b"\0")


@pytest.mark.parametrize("kind", [ros.Image, ros.CompressedImage])
def test_a_picture_that_promises_more_than_it_brings_is_refused(kind: Any) -> None:
    """The length of its bytes is a stranger's word."""
    whole = kind(data=bytes(range(100))).serialize()
    assert bytes(kind.deserialize(whole).data) == bytes(range(100))
    for length in range(8, len(whole)):
        with pytest.raises((ValueError, struct.error)):
            kind.deserialize(whole[:length])
