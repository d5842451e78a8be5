"""ROS 2 messages as DDS types, with the names and fields of ROS 2's own definitions.

A message type `sensor_msgs/msg/Image` is the DDS type `sensor_msgs::msg::dds_::Image_`. Units and
frames are those of REP 103: metres, radians, ENU for the world and FLU for the body. Importing this
module needs the extra `ros`.
"""

# No `from __future__ import annotations`: the types of the fields are read at run time.

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import (
    array,
    float32,
    float64,
    int8,
    int32,
    sequence,
    uint8,
    uint16,
    uint32,
)

from aerodaas.extensions.ros2.topics.data_last import data_last

__all__ = [
    "BatteryState",
    "Bool",
    "BoundingBox2D",
    "CameraInfo",
    "CompressedImage",
    "Detection2D",
    "Detection2DArray",
    "Header",
    "Image",
    "NavSatFix",
    "NavSatStatus",
    "ObjectHypothesis",
    "ObjectHypothesisWithPose",
    "Odometry",
    "Point",
    "Point2D",
    "Pose",
    "Pose2D",
    "PoseStamped",
    "PoseWithCovariance",
    "Quaternion",
    "RegionOfInterest",
    "TFMessage",
    "Time",
    "Transform",
    "TransformStamped",
    "Twist",
    "TwistStamped",
    "TwistWithCovariance",
    "Vector3",
]

if TYPE_CHECKING:
    Float64x9: TypeAlias = list[float]
    Float64x36: TypeAlias = list[float]
    Float64x12: TypeAlias = list[float]
    Float64s: TypeAlias = list[float]
    Float32s: TypeAlias = list[float]
    Octets: TypeAlias = bytes
else:
    # What the binding reads, and no type checker understands.
    Float64x9 = array[float64, 9]
    Float64x36 = array[float64, 36]
    Float64x12 = array[float64, 12]
    Float64s = sequence[float64]
    Float32s = sequence[float32]
    Octets = sequence[uint8]


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """Seconds and nanoseconds since the epoch of the sender's clock, which may be simulated."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """Time stamp and frame of reference."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    """A truth value."""

    data: bool = False


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """A free vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    """A place in metres."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    """A rotation; of length one."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    """A place and an attitude."""

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    """A pose in the header's frame."""

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


def _unknown() -> list[float]:
    return [0.0] * 36


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    """A pose; its covariance is 6 x 6 by rows: x, y, z and rotations about them."""

    pose: Pose = field(default_factory=Pose)
    covariance: Float64x36 = field(default_factory=_unknown)


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    """A shift and a rotation."""

    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    """Pose of the frame `child_frame_id` in the header's."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


if TYPE_CHECKING:
    Transforms: TypeAlias = list[TransformStamped]
else:
    Transforms = sequence[TransformStamped]


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    """Poses of frames in others."""

    transforms: Transforms = field(default_factory=list)


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    """Linear velocity in m/s, angular velocity in rad/s."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    """A twist in the header's frame."""

    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    """A twist; its covariance is 6 x 6 by rows."""

    twist: Twist = field(default_factory=Twist)
    covariance: Float64x36 = field(default_factory=_unknown)


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    """Pose in the header's frame, twist in the body's (`child_frame_id`)."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass
class _ImageHead(IdlStruct, typename="sensor_msgs::msg::dds_::ImageHead_"):
    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    encoding: str = ""
    is_bigendian: uint8 = 0
    step: uint32 = 0


@data_last(_ImageHead)
@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    """An uncompressed picture; `step` is the bytes of a row."""

    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    encoding: str = ""
    is_bigendian: uint8 = 0
    step: uint32 = 0
    data: Octets = b""


@dataclass
class _CompressedImageHead(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImageHead_"):
    header: Header = field(default_factory=Header)
    format: str = ""


@data_last(_CompressedImageHead)
@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    """A picture as a JPEG or PNG file."""

    header: Header = field(default_factory=Header)
    format: str = ""
    data: Octets = b""


@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs::msg::dds_::RegionOfInterest_"):
    """The part of a camera's picture that it delivers; all zero: the whole."""

    x_offset: uint32 = 0
    y_offset: uint32 = 0
    height: uint32 = 0
    width: uint32 = 0
    do_rectify: bool = False


@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs::msg::dds_::CameraInfo_"):
    """Lens of a camera: K, R and P by rows, in pixels."""

    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    distortion_model: str = ""
    d: Float64s = field(default_factory=list)
    k: Float64x9 = field(default_factory=lambda: [0.0] * 9)
    r: Float64x9 = field(default_factory=lambda: [0.0] * 9)
    p: Float64x12 = field(default_factory=lambda: [0.0] * 12)
    binning_x: uint32 = 0
    binning_y: uint32 = 0
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)


@dataclass
class NavSatStatus(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatStatus_"):
    """Whether there is a fix, and by which system."""

    status: int8 = 0
    service: uint16 = 0

    STATUS_FIX = 0


@dataclass
class NavSatFix(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatFix_"):
    """Degrees, and metres above the WGS84 ellipsoid; covariance in m^2, 3 x 3 by rows, ENU."""

    header: Header = field(default_factory=Header)
    status: NavSatStatus = field(default_factory=NavSatStatus)
    latitude: float64 = 0.0
    longitude: float64 = 0.0
    altitude: float64 = 0.0
    position_covariance: Float64x9 = field(default_factory=lambda: [0.0] * 9)
    position_covariance_type: uint8 = 0

    COVARIANCE_TYPE_UNKNOWN = 0
    COVARIANCE_TYPE_DIAGONAL_KNOWN = 2


@dataclass
class BatteryState(IdlStruct, typename="sensor_msgs::msg::dds_::BatteryState_"):
    """Volts, amperes (negative when discharging), share of charge; NaN where not measured."""

    header: Header = field(default_factory=Header)
    voltage: float32 = 0.0
    temperature: float32 = 0.0
    current: float32 = 0.0
    charge: float32 = 0.0
    capacity: float32 = 0.0
    design_capacity: float32 = 0.0
    percentage: float32 = 0.0
    power_supply_status: uint8 = 0
    power_supply_health: uint8 = 0
    power_supply_technology: uint8 = 0
    present: bool = False
    cell_voltage: Float32s = field(default_factory=list)
    cell_temperature: Float32s = field(default_factory=list)
    location: str = ""
    serial_number: str = ""

    POWER_SUPPLY_STATUS_DISCHARGING = 2
    POWER_SUPPLY_HEALTH_UNKNOWN = 0
    POWER_SUPPLY_TECHNOLOGY_UNKNOWN = 0


@dataclass
class ObjectHypothesis(IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesis_"):
    """Class of an object and its probability, 0 to 1."""

    class_id: str = ""
    score: float64 = 0.0


@dataclass
class ObjectHypothesisWithPose(
    IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesisWithPose_"
):
    """A hypothesis with a pose in space."""

    hypothesis: ObjectHypothesis = field(default_factory=ObjectHypothesis)
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)


@dataclass
class Point2D(IdlStruct, typename="vision_msgs::msg::dds_::Point2D_"):
    """A place in a picture, pixels."""

    x: float64 = 0.0
    y: float64 = 0.0


@dataclass
class Pose2D(IdlStruct, typename="vision_msgs::msg::dds_::Pose2D_"):
    """A place and a rotation in a picture."""

    position: Point2D = field(default_factory=Point2D)
    theta: float64 = 0.0


@dataclass
class BoundingBox2D(IdlStruct, typename="vision_msgs::msg::dds_::BoundingBox2D_"):
    """A box in a picture, pixels."""

    center: Pose2D = field(default_factory=Pose2D)
    size_x: float64 = 0.0
    size_y: float64 = 0.0


if TYPE_CHECKING:
    Hypotheses: TypeAlias = list[ObjectHypothesisWithPose]
else:
    Hypotheses = sequence[ObjectHypothesisWithPose]


@dataclass
class Detection2D(IdlStruct, typename="vision_msgs::msg::dds_::Detection2D_"):
    """An object found in a picture."""

    header: Header = field(default_factory=Header)
    results: Hypotheses = field(default_factory=list)
    bbox: BoundingBox2D = field(default_factory=BoundingBox2D)
    id: str = ""


if TYPE_CHECKING:
    Detections2D: TypeAlias = list[Detection2D]
else:
    Detections2D = sequence[Detection2D]


@dataclass
class Detection2DArray(IdlStruct, typename="vision_msgs::msg::dds_::Detection2DArray_"):
    """All objects found in a picture."""

    header: Header = field(default_factory=Header)
    detections: Detections2D = field(default_factory=list)
