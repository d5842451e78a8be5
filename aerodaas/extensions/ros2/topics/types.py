"""ROS 2's message types, for bags and live topics: definitions, making, decoding, types of DDS.

The definitions are those of ROS 2 Humble, which later releases share for all types used here. Those
in a bag are never used: a stranger's could hold an array of empty parts, which is read forever.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from aerodaas.config.extras import require_extra
from aerodaas.recording.decoding.limits import MAX_CHUNK, MAX_ROS

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

__all__ = [
    "BATTERY",
    "BOOL",
    "CAMERA_INFO",
    "COMPRESSED_IMAGE",
    "COMPRESSED_VIDEO",
    "DETECTIONS",
    "IMAGE",
    "NAV_SAT_FIX",
    "ODOMETRY",
    "ROS_TYPES",
    "TRANSFORMS",
    "TWIST",
    "TWIST_STAMPED",
    "dds_type",
    "decoder_of",
    "ros_decoder",
    "ros_message",
    "ros_types",
]

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
COMPRESSED_VIDEO = "foxglove_msgs/msg/CompressedVideo"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
ODOMETRY = "nav_msgs/msg/Odometry"
NAV_SAT_FIX = "sensor_msgs/msg/NavSatFix"
BATTERY = "sensor_msgs/msg/BatteryState"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
DETECTIONS = "vision_msgs/msg/Detection2DArray"
TWIST = "geometry_msgs/msg/Twist"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
BOOL = "std_msgs/msg/Bool"
ROS_TYPES = frozenset(
    {
        IMAGE,
        COMPRESSED_IMAGE,
        COMPRESSED_VIDEO,
        CAMERA_INFO,
        ODOMETRY,
        NAV_SAT_FIX,
        BATTERY,
        TRANSFORMS,
    }
)
"""Types whose messages are decoded."""
_PICTURES = frozenset({IMAGE, COMPRESSED_IMAGE, COMPRESSED_VIDEO})

_DEFINITIONS = {
    COMPRESSED_VIDEO: "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\n"
    "string format",
    # vision_msgs 4, of Humble and later.
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\n"
    "geometry_msgs/PoseWithCovariance pose",
    "vision_msgs/msg/Detection2D": "std_msgs/Header header\n"
    "vision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox2D bbox\nstring id",
    DETECTIONS: "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
}
"""What ROS 2 itself does not bring."""


@cache
def ros_types() -> Typestore:
    """All types by name, to make, encode and decode messages.

    Raises:
        ConfigError: If the extra `ros` is not installed.
    """
    require_extra("ros", "a ROS 2 message")
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.max_sequence_length = MAX_CHUNK
    for name, definition in _DEFINITIONS.items():
        store.register(get_types_from_msg(definition, name))
    return store


def decoder_of(name: str) -> Callable[[bytes], Any] | None:
    """Decoder of the messages of a schema in CDR; None for a schema beyond `ROS_TYPES`.

    Raises:
        ConfigError: If the extra `ros` is not installed.
    """
    return ros_decoder(name) if name in ROS_TYPES else None


def ros_decoder(name: str) -> Callable[[bytes], Any]:
    """Decoder of the messages of one of `ROS_TYPES`, in CDR.

    Raises:
        ConfigError: If the extra `ros` is not installed.
    """
    store = ros_types()
    bound = MAX_CHUNK if name in _PICTURES else MAX_ROS

    def decode(data: bytes) -> Any:  # noqa: ANN401 - a type made at run time
        if len(data) > bound:
            raise ValueError(f"a {name} of {len(data)} bytes exceeds {bound}")
        return store.deserialize_cdr(data, name)

    return decode


def ros_message(name: str, **fields: Any) -> Any:  # noqa: ANN401
    """A message of a type; fields that are not given are zero or empty.

    Args:
        name: ROS 2's name of the type, such as `nav_msgs/msg/Odometry`.
        fields: Values by the names of fields; arrays of numbers are numpy's.

    Raises:
        ConfigError: If the extra `ros` is not installed.
    """
    store = ros_types()
    for field, (kind, detail) in _fields(name):
        if field not in fields:
            fields[field] = _zero(kind.name, detail)
    return store.types[name](**fields)


def _zero(kind: str, detail: Any) -> Any:  # noqa: ANN401
    if kind == "NAME":
        return ros_message(detail)
    if kind == "BASE":
        return "" if detail[0] == "string" else np.dtype(detail[0]).type().item()
    (element, (number, *_)), length = detail
    return [] if element.name == "NAME" else np.zeros(length, number)


@cache
def dds_type(name: str) -> Any:  # noqa: ANN401
    """The type of DDS `sensor_msgs::msg::dds_::Image_` of the type `sensor_msgs/msg/Image`.

    Its `message` is one of `ros_message`; encoding and decoding are those of bags.
    """
    from cyclonedds.idl import make_idl_struct  # noqa: PLC0415 - an extra

    store = ros_types()
    fields = {field: _dds_field(kind.name, detail) for field, (kind, detail) in _fields(name)}
    package, _, own = name.split("/")
    made: Any = make_idl_struct(own, f"{package}::msg::dds_::{own}_", fields, dataclassify=False)

    def construct(self: Any, message: object) -> None:  # noqa: ANN401
        self.message = message

    def serialize(self: Any, *_: object, **__: object) -> bytes:  # noqa: ANN401
        return bytes(store.serialize_cdr(self.message, name))

    def deserialize(data: bytes, *_: object, **__: object) -> object:
        return store.deserialize_cdr(data, name)

    made.__init__, made.serialize = construct, serialize
    made.deserialize = staticmethod(deserialize)
    return made


def _fields(name: str) -> Any:  # noqa: ANN401
    return ros_types().fielddefs[name][1]


def _dds_field(kind: str, detail: Any) -> Any:  # noqa: ANN401
    from cyclonedds.idl import types  # noqa: PLC0415 - an extra

    if kind == "NAME":
        return dds_type(detail)
    if kind == "BASE":
        known = {"string": str, "bool": bool}
        return known.get(detail[0]) or getattr(types, detail[0])
    (element, content), length = detail
    inner = _dds_field(element.name, content)
    return types.array[inner, length] if kind == "ARRAY" else types.sequence[inner]
