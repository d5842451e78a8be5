"""Messages and their types of DDS, by rosbags' definitions."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.extensions.ros2.topics.names import ros_type
from aerodaas.extensions.ros2.topics.types import (
    BATTERY,
    BOOL,
    COMPRESSED_IMAGE,
    DETECTIONS,
    IMAGE,
    NAV_SAT_FIX,
    ODOMETRY,
    TRANSFORMS,
    TWIST_STAMPED,
    dds_type,
    ros_message,
    ros_types,
)


@pytest.mark.parametrize(
    "name", [BATTERY, BOOL, DETECTIONS, NAV_SAT_FIX, ODOMETRY, TRANSFORMS, TWIST_STAMPED]
)
def test_a_message_travels_as_its_type_of_dds(name: str) -> None:
    """By ROS 2's name, with fields of the definition, in the bytes of either order."""
    store, kind = ros_types(), dds_type(name)
    message = ros_message(name)
    assert ros_type(kind.__idl_typename__) == name
    assert list(kind.__annotations__) == [field for field, _ in store.fielddefs[name][1]]
    encoded = kind(message).serialize()
    big = bytes(store.serialize_cdr(message, name, little_endian=False))
    for data in (encoded, big):
        assert kind(kind.deserialize(data)).serialize() == encoded


@pytest.mark.parametrize("name", [IMAGE, COMPRESSED_IMAGE])
def test_a_picture_that_promises_more_than_it_brings_is_refused(name: str) -> None:
    """The length of its bytes is a stranger's word."""
    kind = dds_type(name)
    whole = kind(ros_message(name, data=np.arange(100, dtype=np.uint8))).serialize()
    assert kind.deserialize(whole).data.tolist() == list(range(100))
    for length in range(8, len(whole), 7):
        with pytest.raises(Exception, match=r".*") as caught:
            kind.deserialize(whole[:length])
        assert not isinstance(caught.value, MemoryError)
