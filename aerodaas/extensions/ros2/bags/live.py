"""A flight on ROS 2 topics while it goes on, by DDS: what a bag of its recording would hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from aerodaas.extensions.ros2.bags import typestore
from aerodaas.extensions.ros2.bags.outgoing import MessageBuilder
from aerodaas.extensions.ros2.topics.link import RosLink, RosPublisher, domain_of, require_dds
from aerodaas.extensions.ros2.topics.names import permitted_topic, ros_type
from aerodaas.geometry.frames import CameraModel, is_finite
from aerodaas.messages.detections import Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.converters.images import EncodedFrame
from aerodaas.recording.reference_frames import MAP_FRAME, OPTICAL, base_link, compose, from_rpy

__all__ = ["RosGraph", "prepare"]


def prepare() -> int:
    """The DDS domain of the environment variable ROS_DOMAIN_ID, or 0.

    Raises:
        ConfigError: If Cyclone DDS is not installed, or the variable is no domain.
    """
    require_dds("the view ros2")
    return domain_of(None)


class RosGraph:
    """Publishes states, pictures and detections of a run; costs nearly nothing where none listens.

    Topics, types and frames are those of `bag_writer.write_bag`. What nobody subscribes to is not
    made; static transforms are kept for those who come later.
    """

    def __init__(self, domain: int, epoch_ns: int, jpeg_quality: int = 85) -> None:
        """Join `domain`; stamps count from `epoch_ns` (Unix, nanoseconds).

        Raises as `RosLink`.
        """
        self._link = RosLink(domain)
        from aerodaas.extensions.ros2.topics import messages  # noqa: PLC0415 - needs the extra

        self._kinds = {
            ros_type(kind.__idl_typename__): kind
            for kind in (getattr(messages, name) for name in messages.__all__)
        }
        types = {name: _Type(kind) for name, kind in self._kinds.items()}
        self._build = MessageBuilder(types, epoch_ns)
        self._quality = [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality]
        self._publishers: dict[str, RosPublisher] = {}
        self._newest: dict[str, int] = {}
        """Stamp of the newest state by robot."""
        self._mounts: dict[str, CameraModel] = {}
        """Camera by its frame, as its transform was published."""
        self._static: dict[str, Any] = {}
        """Transform by that frame."""

    def put(self, message: Message[Any]) -> None:
        """Publish what ROS 2 has messages for; nothing else."""
        item = message.item
        if isinstance(item, VehicleState):
            robot = (message.header.source or message.stream).partition("/")[0]
            self._state(item, robot)
        elif isinstance(item, Frame | EncodedFrame):
            self._picture(item, message.stream)
        elif isinstance(item, Detections):
            self._publish(
                f"/{message.stream}/detections",
                typestore.DETECTIONS,
                lambda: self._build.detections(item),
            )

    def close(self) -> None:
        """Leave the domain."""
        self._link.close()

    def _state(self, state: VehicleState, robot: str) -> None:
        odometry, stamp, build = state.odometry, state.stamp, self._build
        # Readers of transforms refuse one that is not newer than the one before.
        if stamp <= self._newest.get(robot, -1) or not is_finite(odometry.position):
            return
        self._newest[robot] = stamp
        self._publish(
            f"/{robot}/battery",
            typestore.BATTERY,
            lambda: build.battery(state.battery, stamp, robot),
        )
        fix = state.gps
        if fix is not None:
            self._publish(
                f"/{robot}/fix", typestore.NAV_SAT_FIX, lambda: build.fix(fix, stamp, robot)
            )
        self._publish(
            f"/{robot}/odometry",
            typestore.ODOMETRY,
            lambda: build.odometry(odometry, stamp, robot),
        )
        attitude = from_rpy(odometry.roll, odometry.pitch, odometry.yaw)
        self._publish(
            "/tf",
            typestore.TRANSFORMS,
            lambda: build.transform(
                stamp, MAP_FRAME, base_link(robot), odometry.position, attitude
            ),
        )

    def _picture(self, item: Frame | EncodedFrame, stream: str) -> None:
        stamp, frame, build = item.header.stamp, item.header.source, self._build

        def encoded() -> Any:  # noqa: ANN401 - an IdlStruct
            if isinstance(item, EncodedFrame):
                return build.compressed_image(item.data, item.format, stamp, frame)
            _, data = cv2.imencode(".jpg", item.image, self._quality)
            return build.compressed_image(data.tobytes(), "jpeg", stamp, frame)

        self._publish(f"/{stream}/image/compressed", typestore.COMPRESSED_IMAGE, encoded)
        camera = item.camera
        if camera is not None:
            self._lens(camera, stream, stamp, frame)
        depth = item.depth if isinstance(item, Frame) else None
        if depth is not None:
            self._publish(
                f"/{stream}/aligned_depth",
                typestore.IMAGE,
                lambda: build.depth_image(depth, stamp, frame),
            )

    def _lens(self, camera: CameraModel, stream: str, stamp: int, frame: str) -> None:
        build = self._build
        matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
        self._publish(
            f"/{stream}/camera_info",
            typestore.CAMERA_INFO,
            lambda: build.camera_info((camera.width, camera.height), matrix, stamp, frame),
        )
        if self._mounts.get(frame) != camera and "/" in frame:
            self._mounts[frame] = camera
            place = np.array(camera.mount, np.float64)
            turned = compose(from_rpy(camera.roll, camera.pitch, camera.yaw), OPTICAL)
            body = base_link(frame.partition("/")[0])
            static = build.transform(stamp, body, frame, place, turned)
            self._static[frame] = static.transforms[0]
            # All of them each time: who comes later hears the last message only.
            static.transforms = list(self._static.values())
            self._publish("/tf_static", typestore.TRANSFORMS, lambda: static, latched=True)

    def _publish(
        self, topic: str, kind: str, make: Callable[[], Any], *, latched: bool = False
    ) -> None:
        """Publish what `make` returns, where somebody listens; `latched`: or may come later."""
        name = permitted_topic(topic)
        publisher = self._publishers.get(name)
        if publisher is None:
            publisher = self._link.publisher(name, self._kinds[kind], latched=latched)
            self._publishers[name] = publisher
        if latched or publisher.listeners:
            publisher.publish(make())


class _Type:
    """A message type of DDS that takes arrays where it has lists, as that of a bag does."""

    def __init__(self, kind: Any) -> None:  # noqa: ANN401 - made by a metaclass
        self._kind = kind

    def __call__(self, **fields: Any) -> Any:  # noqa: ANN401
        return self._kind(**{name: _plain(value) for name, value in fields.items()})

    def __getattr__(self, constant: str) -> Any:  # noqa: ANN401
        return getattr(self._kind, constant)


def _plain(value: Any) -> Any:  # noqa: ANN401
    if not isinstance(value, np.ndarray):
        return value
    return value.tobytes() if value.dtype == np.uint8 else value.tolist()
