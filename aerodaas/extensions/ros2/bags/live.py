"""A flight on ROS 2 topics while it goes on, by DDS: what a bag of its recording would hold."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from aerodaas.extensions.ros2.bags.outgoing import Lens, MessageBuilder, Outgoing
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.link import RosLink, RosPublisher, domain_of, require_dds
from aerodaas.extensions.ros2.topics.names import permitted_topic
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.converters.images import EncodedFrame
from aerodaas.recording.reference_frames import OPTICAL, base_link, compose, from_rpy

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
        self._build = MessageBuilder(epoch_ns)
        self._quality = [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality]
        self._publishers: dict[str, RosPublisher] = {}
        self._mounts: dict[str, CameraModel] = {}
        """Camera by its frame, as its transform was published."""
        self._static: dict[str, Any] = {}
        """Transform by that frame."""

    def put(self, message: Message[Any]) -> None:
        """Publish what ROS 2 has messages for; nothing else."""
        item = message.item
        if isinstance(item, VehicleState):
            robot = (message.header.source or message.stream).partition("/")[0]
            for outgoing in self._build.state(item, robot):
                self._publish(outgoing)
        elif isinstance(item, Frame | EncodedFrame):
            self._picture(item, f"/{message.stream}")
        elif isinstance(item, Detections):
            topic = f"/{message.stream}/detections"
            self._publish(Outgoing(topic, types.DETECTIONS, lambda: self._build.detections(item)))

    def close(self) -> None:
        """Leave the domain."""
        self._link.close()

    def _picture(self, item: Frame | EncodedFrame, stream: str) -> None:
        def encoded() -> tuple[bytes, str]:
            if isinstance(item, EncodedFrame):
                return item.data, item.format
            _, data = cv2.imencode(".jpg", item.image, self._quality)
            return data.tobytes(), "jpeg"

        camera, lens = item.camera, None
        if camera is not None:
            matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
            lens = Lens((camera.width, camera.height), matrix)
        depth = item.depth if isinstance(item, Frame) else None
        for outgoing in self._build.picture(stream, item.header, encoded, lens, depth):
            self._publish(outgoing)
        frame = item.header.source
        if camera is not None and self._mounts.get(frame) != camera and "/" in frame:
            self._publish_mount(camera, item.header.stamp, frame)

    def _publish_mount(self, camera: CameraModel, stamp: int, frame: str) -> None:
        self._mounts[frame] = camera
        place = np.array(camera.mount, np.float64)
        turned = compose(from_rpy(camera.roll, camera.pitch, camera.yaw), OPTICAL)
        body = base_link(frame.partition("/")[0])
        self._static[frame] = self._build.transform(stamp, body, frame, place, turned)
        # All of them each time: who comes later hears the last message only.
        static = self._build.transforms(*self._static.values())
        self._publish(Outgoing("/tf_static", types.TRANSFORMS, lambda: static), latched=True)

    def _publish(self, outgoing: Outgoing, *, latched: bool = False) -> None:
        """Publish where somebody listens; `latched`: or may come later."""
        name = permitted_topic(outgoing.topic)
        publisher = self._publishers.get(name)
        if publisher is None:
            publisher = self._link.publisher(name, outgoing.type, latched=latched)
            self._publishers[name] = publisher
        if latched or publisher.listeners:
            publisher.publish(outgoing.make())
