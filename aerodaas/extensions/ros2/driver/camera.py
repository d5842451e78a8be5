"""Camera whose pictures are messages of a ROS 2 topic."""

from __future__ import annotations

import logging
import math
import threading
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.base import Picture
from aerodaas.cameras.images import decode_image
from aerodaas.cameras.settings import camera_model
from aerodaas.clock import host_time_ns
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.errors import SourceError
from aerodaas.extensions.ros2.driver.settings import Ros2CameraSettings, ros2_camera_settings
from aerodaas.extensions.ros2.topics.incoming import stamp_of
from aerodaas.extensions.ros2.topics.link import RosLink, domain_of, require_dds
from aerodaas.extensions.ros2.topics.stamps import MessageClock
from aerodaas.extensions.ros2.topics.types import COMPRESSED_IMAGE, IMAGE
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry

__all__ = ["Ros2Camera"]

_log = logging.getLogger(__name__)
_SILENT = 3.0
"""Seconds without a picture after which that is logged."""
_FIRST_PICTURE = 10.0
"""Seconds that the first picture is waited for."""
_COMPRESSED = "/compressed"
"""End of the names of compressed pictures' topics, by image_transport's convention."""


class Ros2Camera:
    """The newest picture of a `sensor_msgs/Image` or `sensor_msgs/CompressedImage` topic.

    Only what is captured is decoded. Raises ConfigError if its settings are not those of a
    `Ros2CameraSettings`.
    """

    settings_model = Ros2CameraSettings
    finished = False
    """Always False: a publisher may come back."""
    most_memory = 2 << 30
    """Bytes that its process may allocate: what somebody else sends is decoded."""

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        """Validate the settings of `sensor`; nothing is opened."""
        require_dds(f"sensor {sensor.full_id}: the driver ros2")
        self._name = sensor.full_id
        self._settings = settings = ros2_camera_settings(sensor, environment)
        self._domain = domain_of(settings.domain)
        self._schema = COMPRESSED_IMAGE if settings.topic.endswith(_COMPRESSED) else IMAGE
        self._lock = threading.Lock()
        self._clock = MessageClock(settings.stamps)
        self._link: RosLink | None = None
        self._newest: tuple[Any, int] | None = None
        self._broken = 0
        self._heard_at = math.inf
        self._told = False
        self._model: CameraModel | None = None

    @property
    def model(self) -> CameraModel | None:
        """Calibration for the size of the newest picture; None before the first."""
        return self._model

    @property
    def skipped(self) -> int:
        """Number of pictures that could not be decoded."""
        return self._broken + (0 if self._link is None else self._link.garbled)

    def open(self) -> None:
        """Join the domain and wait for a picture; raises SourceError without one."""
        self.close()
        self._link = link = RosLink(self._domain)
        try:
            link.subscribe(self._settings.topic, self._schema, self._on_image)
            deadline = time.monotonic() + _FIRST_PICTURE
            while not self._first():
                self._wait(link, deadline)
        except BaseException:
            self.close()
            raise

    def _wait(self, link: RosLink, deadline: float) -> None:
        if time.monotonic() >= deadline:
            raise SourceError(self._why_none(link))
        time.sleep(0.02)

    def _first(self) -> bool:
        with self._lock:
            newest = self._newest
        image = None if newest is None else self._decoded(newest[0])
        if image is not None:
            self._model = camera_model(self._settings, image.shape[1], image.shape[0])
        return image is not None

    def _why_none(self, link: RosLink) -> str:
        topic, found = self._settings.topic, link.published()
        if self.skipped:
            return f"{self._name}: the pictures of {topic} cannot be decoded: they are damaged"
        if found.get(topic, self._schema) != self._schema:
            return f"{self._name}: {topic} is {found[topic]}, and not {self._schema}"
        fitting = [name for name, kind in found.items() if kind == self._schema]
        there = f"there are {', '.join(fitting)}" if fitting else "there is no other of its type"
        return (
            f"{self._name}: no picture on {topic} ({self._schema}) in the ROS 2 domain "
            f"{self._domain}; {there}. Check the setting, ROS_DOMAIN_ID, and that the network "
            "carries multicast (docs/ros2.md)"
        )

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the newest picture; None if there is no new one.

        Args:
            stamp: Mission clock, nanoseconds; the picture's age is subtracted.
            pose: Ignored.

        Raises:
            SourceError: If the pixel format is not known.
        """
        del pose
        with self._lock:
            newest, self._newest = self._newest, None
        self._tell_of_silence(silent=newest is None)
        if newest is None:
            return None
        message, measured = newest
        image = self._decoded(message)
        if image is None:
            return None
        self._model = camera_model(self._settings, image.shape[1], image.shape[0])
        return Picture(image, max(0, stamp - (host_time_ns() - measured)), self._settings.topic)

    def _tell_of_silence(self, *, silent: bool) -> None:
        """Log once that no pictures come, and once that they do again."""
        now = time.monotonic()
        if not silent:
            self._heard_at = now
        lost = now - self._heard_at > _SILENT
        if lost != self._told:
            self._told = lost
            what = f"no picture for {_SILENT:.0f} s" if lost else "there are pictures again"
            _log.warning("%s: %s on %s", self._name, what, self._settings.topic)

    def close(self) -> None:
        """Leave the domain."""
        link, self._link = self._link, None
        if link is not None:
            link.close()

    def _on_image(self, message: Any) -> None:  # noqa: ANN401 - of a type made at import
        arrival = host_time_ns()
        with self._lock:
            age = self._clock.age(stamp_of(message), arrival)
            if age is not None:
                self._newest = message, arrival - age

    def _decoded(self, message: Any) -> NDArray[np.uint8] | None:  # noqa: ANN401
        image = decode_image(self._schema, message)
        if image is None:
            self._broken += 1
        return image
