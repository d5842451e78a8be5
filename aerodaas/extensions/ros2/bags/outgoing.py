"""ROS 2 messages of a recording's or a flight's values.

By REP 103 and REP 105: positions in `map`, which is ENU as ours; `ROBOT/base_link` is FLU; a
camera's frame, named as the camera, is optical (x right, y down, z forward). Figures that are not
known are NaN, and covariances zero, as the messages' definitions ask.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.types import ros_message
from aerodaas.geometry.frames import Vector, is_finite
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.reference_frames import MAP_FRAME, Rotation, base_link, body_twist, from_rpy

__all__ = ["Lens", "MessageBuilder", "Outgoing"]

_DISTORTION = "plumb_bob"
"""The model whose coefficients, all zero here, mean none."""
_SERVICE_GPS = 1


class Outgoing(NamedTuple):
    """A message for a topic, which is made when somebody wants it."""

    topic: str
    """Name, with characters that ROS 2 may not permit."""
    type: str
    make: Callable[[], Any]


class Lens(NamedTuple):
    """Undistorted lens of a camera."""

    size: tuple[int, int]
    """Width and height in pixels."""
    matrix: list[float]
    """Nine elements of K, row by row, in pixels."""


class MessageBuilder:
    """Makes ROS 2 messages; stamps are mission time in nanoseconds."""

    def __init__(self, epoch_ns: int) -> None:
        """Stamps count from `epoch_ns` (Unix, nanoseconds)."""
        self._epoch_ns = epoch_ns
        self._newest: dict[str, int] = {}
        """Stamp of the newest state by robot."""

    def state(self, state: VehicleState, robot: str) -> Iterator[Outgoing]:
        """Battery, fix, odometry and transform of a robot's state.

        A state that is no newer than one before makes no message: readers of transforms refuse it.

        Args:
            state: State of the vehicle.
            robot: Id of the robot.
        """
        odometry, stamp, fix = state.odometry, state.stamp, state.gps
        if stamp <= self._newest.get(robot, stamp - 1) or not is_finite(odometry.position):
            return
        self._newest[robot] = stamp
        # Before the odometry, so that who reads on has all of the moment by then.
        yield Outgoing(
            f"/{robot}/battery", types.BATTERY, lambda: self._battery(state.battery, stamp, robot)
        )
        if fix is not None:
            yield Outgoing(f"/{robot}/fix", types.NAV_SAT_FIX, lambda: self._fix(fix, stamp, robot))
        yield Outgoing(
            f"/{robot}/odometry", types.ODOMETRY, lambda: self.odometry(odometry, stamp, robot)
        )
        attitude = from_rpy(odometry.roll, odometry.pitch, odometry.yaw)
        yield Outgoing(
            "/tf",
            types.TRANSFORMS,
            lambda: self.transforms(
                self.transform(stamp, MAP_FRAME, base_link(robot), odometry.position, attitude)
            ),
        )

    def picture(
        self,
        stream: str,
        header: Header,
        file: Callable[[], tuple[bytes, str]],
        lens: Lens | None,
        depth: NDArray[np.uint16] | None,
    ) -> Iterator[Outgoing]:
        """A picture with its lens and depth, of one stamp.

        Args:
            stream: Name of the camera's stream, with a leading slash.
            header: Header of the picture.
            file: Makes the content of the picture's file and its format, `jpeg`, `png` or `webp`.
            lens: None where it is not known.
            depth: Millimetres, height x width, 0 where not measured; None without depth.
        """
        stamp, frame = header.stamp, header.source
        yield Outgoing(
            f"{stream}/image/compressed",
            types.COMPRESSED_IMAGE,
            lambda: self._compressed_image(*file(), stamp, frame),
        )
        if lens is not None:
            yield Outgoing(
                f"{stream}/camera_info",
                types.CAMERA_INFO,
                lambda: self._camera_info(lens, stamp, frame),
            )
        if depth is not None:
            yield Outgoing(
                f"{stream}/aligned_depth",
                types.IMAGE,
                lambda: self._depth_image(depth, stamp, frame),
            )

    def odometry(self, value: Odometry, stamp: int, robot: str) -> Any:  # noqa: ANN401 - a type made at run time
        """`nav_msgs/Odometry`: the pose in `map`, velocity and rates in the body's own axes.

        Of the body's rates only the turn about the vertical is known.

        Args:
            value: Odometry of the vehicle.
            stamp: Mission time, nanoseconds.
            robot: Id of the robot.
        """
        velocity, rates = body_twist(value)
        message = ros_message(
            types.ODOMETRY, header=self._header(stamp, MAP_FRAME), child_frame_id=base_link(robot)
        )
        message.pose.covariance[[0, 7, 14]] = value.position_sigma**2
        pose, twist = message.pose.pose, message.twist.twist
        _assign(pose.position, value.position)
        _assign(pose.orientation, from_rpy(value.roll, value.pitch, value.yaw))
        _assign(twist.linear, velocity)
        _assign(twist.angular, rates)
        return message

    def transform(
        self, stamp: int, parent: str, child: str, place: Vector, rotation: Rotation
    ) -> Any:  # noqa: ANN401
        """`geometry_msgs/TransformStamped` with the pose of one frame in another.

        Args:
            stamp: Mission time, nanoseconds.
            parent: Frame in which the pose is.
            child: Frame whose pose it is.
            place: Position, metres.
            rotation: Quaternion x, y, z, w.
        """
        message = ros_message(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(stamp, parent),
            child_frame_id=child,
        )
        _assign(message.transform.translation, place)
        _assign(message.transform.rotation, rotation)
        return message

    @staticmethod
    def transforms(*transforms: Any) -> Any:  # noqa: ANN401
        """`tf2_msgs/TFMessage` of transforms."""
        return ros_message(types.TRANSFORMS, transforms=list(transforms))

    def detections(self, value: Detections) -> Any:  # noqa: ANN401
        """`vision_msgs/Detection2DArray` with the stamp and frame of its picture."""
        header = self._header(value.header.stamp, value.header.source)
        found = []
        for item in value:
            left, top, right, bottom = item.box
            result = ros_message("vision_msgs/msg/ObjectHypothesisWithPose")
            result.hypothesis.class_id, result.hypothesis.score = item.label, item.score
            result.pose.pose.orientation.w = 1.0
            box = ros_message(
                "vision_msgs/msg/BoundingBox2D", size_x=right - left, size_y=bottom - top
            )
            box.center.position.x, box.center.position.y = item.centre
            found.append(
                ros_message(
                    "vision_msgs/msg/Detection2D",
                    header=header,
                    results=[result],
                    bbox=box,
                    id="" if item.track_id is None else str(item.track_id),
                )
            )
        return ros_message(types.DETECTIONS, header=header, detections=found)

    def _battery(self, value: Battery, stamp: int, robot: str) -> Any:  # noqa: ANN401
        """`sensor_msgs/BatteryState`; a current that is drawn is negative there."""
        message = ros_message(
            types.BATTERY,
            header=self._header(stamp, base_link(robot)),
            voltage=value.voltage or math.nan,
            temperature=math.nan,
            current=-value.current or math.nan,
            charge=math.nan,
            capacity=math.nan,
            design_capacity=math.nan,
            percentage=value.fraction,
            present=True,
        )
        message.power_supply_status = message.POWER_SUPPLY_STATUS_DISCHARGING
        return message

    def _fix(self, value: GpsFix, stamp: int, robot: str) -> Any:  # noqa: ANN401
        """`sensor_msgs/NavSatFix`: degrees, and metres above the WGS84 ellipsoid."""
        horizontal, vertical = value.horizontal_sigma**2, value.vertical_sigma**2
        message = ros_message(
            types.NAV_SAT_FIX,
            header=self._header(stamp, base_link(robot)),
            latitude=value.latitude,
            longitude=value.longitude,
            altitude=value.altitude,
            position_covariance=np.diag([horizontal, horizontal, vertical]).ravel(),
        )
        message.status.status = message.status.STATUS_FIX
        message.status.service = _SERVICE_GPS
        if horizontal:
            message.position_covariance_type = message.COVARIANCE_TYPE_DIAGONAL_KNOWN
        return message

    def _compressed_image(self, data: bytes, kind: str, stamp: int, frame: str) -> Any:  # noqa: ANN401
        return ros_message(
            types.COMPRESSED_IMAGE,
            header=self._header(stamp, frame),
            format=kind,
            data=np.frombuffer(data, np.uint8),
        )

    def _depth_image(self, depth: NDArray[np.uint16], stamp: int, frame: str) -> Any:  # noqa: ANN401
        """`sensor_msgs/Image` of depth by REP 118, as 16UC1."""
        height, width = depth.shape
        return ros_message(
            types.IMAGE,
            header=self._header(stamp, frame),
            height=height,
            width=width,
            encoding="16UC1",
            step=2 * width,
            data=np.frombuffer(depth.astype("<u2").tobytes(), np.uint8),
        )

    def _camera_info(self, lens: Lens, stamp: int, frame: str) -> Any:  # noqa: ANN401
        fx, _, cx, _, fy, cy, *_ = lens.matrix
        return ros_message(
            types.CAMERA_INFO,
            header=self._header(stamp, frame),
            height=lens.size[1],
            width=lens.size[0],
            distortion_model=_DISTORTION,
            d=np.zeros(5),
            k=np.array(lens.matrix, np.float64),
            r=np.eye(3).ravel(),
            p=np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0], np.float64),
        )

    def _header(self, stamp: int, frame: str) -> Any:  # noqa: ANN401
        header = ros_message("std_msgs/msg/Header", frame_id=frame)
        header.stamp.sec, header.stamp.nanosec = divmod(self._epoch_ns + stamp, NANOSECONDS)
        return header


def _assign(message: Any, values: Any) -> None:  # noqa: ANN401
    """Set x, y, z and, of a quaternion, w."""
    for axis, value in zip("xyzw", values, strict=False):
        setattr(message, axis, float(value))
