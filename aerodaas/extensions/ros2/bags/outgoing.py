"""ROS 2 messages of a recording's or a flight's values.

By REP 103 and REP 105: positions in `map`, which is ENU as ours; `ROBOT/base_link` is FLU; a
camera's frame, named as the camera, is optical (x right, y down, z forward). Figures that are not
known are NaN, and covariances zero, as the messages' definitions ask.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.extensions.ros2.bags import typestore
from aerodaas.geometry.frames import Vector
from aerodaas.messages.detections import Detections
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.recording.reference_frames import MAP_FRAME, Rotation, base_link, body_twist, from_rpy

__all__ = ["MessageBuilder"]

_DISTORTION = "plumb_bob"
"""The model whose coefficients, all zero here, mean none."""
_SERVICE_GPS = 1


class MessageBuilder:
    """Makes ROS 2 messages; stamps are mission time in nanoseconds."""

    def __init__(self, types: Mapping[str, Any], epoch_ns: int) -> None:
        """Build messages of `types`, which are callable with their fields, by name.

        Stamps count from `epoch_ns` (Unix, nanoseconds).
        """
        self._types = types
        self._epoch_ns = epoch_ns

    def odometry(self, value: Odometry, stamp: int, robot: str) -> Any:  # noqa: ANN401 - a type made at run time
        """`nav_msgs/Odometry`: the pose in `map`, velocity and rates in the body's own axes.

        Of the body's rates only the turn about the vertical is known.

        Args:
            value: Odometry of the vehicle.
            stamp: Mission time, nanoseconds.
            robot: Id of the robot.
        """
        velocity, rates = body_twist(value)
        covariance = np.zeros(36)
        covariance[[0, 7, 14]] = value.position_sigma**2
        pose = self._make(
            "geometry_msgs/msg/Pose",
            position=self._point(value.position),
            orientation=self._quaternion(from_rpy(value.roll, value.pitch, value.yaw)),
        )
        twist = self._make(
            "geometry_msgs/msg/Twist",
            linear=self._vector(velocity),
            angular=self._vector(rates),
        )
        return self._make(
            typestore.ODOMETRY,
            header=self.header(stamp, MAP_FRAME),
            child_frame_id=base_link(robot),
            pose=self._make(
                "geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance
            ),
            twist=self._make(
                "geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)
            ),
        )

    def transform(
        self, stamp: int, parent: str, child: str, place: Vector, rotation: Rotation
    ) -> Any:  # noqa: ANN401
        """`tf2_msgs/TFMessage` with the pose of one frame in another.

        Args:
            stamp: Mission time, nanoseconds.
            parent: Frame in which the pose is.
            child: Frame whose pose it is.
            place: Position, metres.
            rotation: Quaternion x, y, z, w.
        """
        transform = self._make(
            "geometry_msgs/msg/Transform",
            translation=self._vector(place),
            rotation=self._quaternion(rotation),
        )
        stamped = self._make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(stamp, parent),
            child_frame_id=child,
            transform=transform,
        )
        return self._make(typestore.TRANSFORMS, transforms=[stamped])

    def battery(self, value: Battery, stamp: int, robot: str) -> Any:  # noqa: ANN401
        """`sensor_msgs/BatteryState`; a current that is drawn is negative there.

        Args:
            value: Reading of the battery.
            stamp: Mission time, nanoseconds.
            robot: Id of the robot.
        """
        kind = self._types[typestore.BATTERY]
        return kind(
            header=self.header(stamp, base_link(robot)),
            voltage=value.voltage or math.nan,
            temperature=math.nan,
            current=-value.current or math.nan,
            charge=math.nan,
            capacity=math.nan,
            design_capacity=math.nan,
            percentage=value.fraction,
            power_supply_status=kind.POWER_SUPPLY_STATUS_DISCHARGING,
            power_supply_health=kind.POWER_SUPPLY_HEALTH_UNKNOWN,
            power_supply_technology=kind.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
            present=True,
            cell_voltage=np.zeros(0, np.float32),
            cell_temperature=np.zeros(0, np.float32),
            location="",
            serial_number="",
        )

    def fix(self, value: GpsFix, stamp: int, robot: str) -> Any:  # noqa: ANN401
        """`sensor_msgs/NavSatFix`: degrees, and metres above the WGS84 ellipsoid.

        Args:
            value: GPS fix.
            stamp: Mission time, nanoseconds.
            robot: Id of the robot.
        """
        kind, status = self._types[typestore.NAV_SAT_FIX], "sensor_msgs/msg/NavSatStatus"
        horizontal, vertical = value.horizontal_sigma**2, value.vertical_sigma**2
        return kind(
            header=self.header(stamp, base_link(robot)),
            status=self._make(status, status=self._types[status].STATUS_FIX, service=_SERVICE_GPS),
            latitude=value.latitude,
            longitude=value.longitude,
            altitude=value.altitude,
            position_covariance=np.diag([horizontal, horizontal, vertical]).ravel(),
            position_covariance_type=kind.COVARIANCE_TYPE_DIAGONAL_KNOWN
            if horizontal
            else kind.COVARIANCE_TYPE_UNKNOWN,
        )

    def compressed_image(self, data: bytes, kind: str, stamp: int, frame: str) -> Any:  # noqa: ANN401
        """`sensor_msgs/CompressedImage` of a whole image file.

        Args:
            data: Content of the file.
            kind: `jpeg`, `png` or `webp`.
            stamp: Mission time, nanoseconds.
            frame: Frame of the camera.
        """
        return self._make(
            typestore.COMPRESSED_IMAGE,
            header=self.header(stamp, frame),
            format=kind,
            data=np.frombuffer(data, np.uint8),
        )

    def depth_image(self, depth: NDArray[np.uint16], stamp: int, frame: str) -> Any:  # noqa: ANN401
        """`sensor_msgs/Image` of depth by REP 118, as 16UC1.

        Args:
            depth: Depth picture, height x width, millimetres; 0 where not measured.
            stamp: Mission time, nanoseconds.
            frame: Frame of the camera.
        """
        height, width = depth.shape
        return self._make(
            typestore.IMAGE,
            header=self.header(stamp, frame),
            height=height,
            width=width,
            encoding="16UC1",
            is_bigendian=0,
            step=2 * width,
            data=np.frombuffer(depth.astype("<u2").tobytes(), np.uint8),
        )

    def camera_info(
        self, size: tuple[int, int], matrix: list[float], stamp: int, frame: str
    ) -> Any:  # noqa: ANN401
        """`sensor_msgs/CameraInfo` of an undistorted lens.

        Args:
            size: Width and height in pixels.
            matrix: Nine elements of K, row by row, in pixels.
            stamp: Mission time, nanoseconds.
            frame: Frame of the camera.
        """
        width, height = size
        fx, _, cx, _, fy, cy, *_ = matrix
        region = self._make(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0,
            y_offset=0,
            height=0,
            width=0,
            do_rectify=False,
        )
        return self._make(
            typestore.CAMERA_INFO,
            header=self.header(stamp, frame),
            height=height,
            width=width,
            distortion_model=_DISTORTION,
            d=np.zeros(5),
            k=np.array(matrix, np.float64),
            r=np.eye(3).ravel(),
            p=np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0], np.float64),
            binning_x=0,
            binning_y=0,
            roi=region,
        )

    def detections(self, value: Detections) -> Any:  # noqa: ANN401
        """`vision_msgs/Detection2DArray` with the stamp and frame of its picture."""
        header = self.header(value.header.stamp, value.header.source)
        nowhere = self._make(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=self._make(
                "geometry_msgs/msg/Pose",
                position=self._point((0.0, 0.0, 0.0)),
                orientation=self._quaternion((0.0, 0.0, 0.0, 1.0)),
            ),
            covariance=np.zeros(36),
        )
        found = []
        for item in value:
            left, top, right, bottom = item.box
            hypothesis = self._make(
                "vision_msgs/msg/ObjectHypothesis", class_id=item.label, score=item.score
            )
            position = self._make("vision_msgs/msg/Point2D", x=item.centre[0], y=item.centre[1])
            box = self._make(
                "vision_msgs/msg/BoundingBox2D",
                center=self._make("vision_msgs/msg/Pose2D", position=position, theta=0.0),
                size_x=right - left,
                size_y=bottom - top,
            )
            result = self._make(
                "vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=nowhere
            )
            track = "" if item.track_id is None else str(item.track_id)
            found.append(
                self._make(
                    "vision_msgs/msg/Detection2D",
                    header=header,
                    results=[result],
                    bbox=box,
                    id=track,
                )
            )
        return self._make(typestore.DETECTIONS, header=header, detections=found)

    def header(self, stamp: int, frame: str) -> Any:  # noqa: ANN401
        """`std_msgs/Header`.

        Args:
            stamp: Mission time, nanoseconds.
            frame: Frame of the message.
        """
        sec, nanosec = divmod(self._epoch_ns + stamp, NANOSECONDS)
        time = self._make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        return self._make("std_msgs/msg/Header", stamp=time, frame_id=frame)

    def _make(self, name: str, **fields: Any) -> Any:  # noqa: ANN401
        return self._types[name](**fields)

    def _point(self, place: Any) -> Any:  # noqa: ANN401
        x, y, z = map(float, place)
        return self._make("geometry_msgs/msg/Point", x=x, y=y, z=z)

    def _vector(self, value: Vector) -> Any:  # noqa: ANN401
        x, y, z = map(float, value)
        return self._make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def _quaternion(self, rotation: Rotation) -> Any:  # noqa: ANN401
        x, y, z, w = rotation
        return self._make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
