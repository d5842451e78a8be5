"""The beginning of a ROS 2 bag: its clock, its cameras' lenses and rates, and its home."""

from __future__ import annotations

import math
from collections import defaultdict
from contextlib import suppress
from typing import Any

import numpy as np

from aerodaas.cameras.images import picture_bytes
from aerodaas.cameras.picture_size import picture_fits, picture_size
from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.recording.ros import typestore
from aerodaas.recording.ros.bag import BagMessage, RosBag
from aerodaas.recording.ros.lens import Place, camera_settings, info_topic, place_of
from aerodaas.recording.ros.topics import BagTopics
from aerodaas.ros.incoming import battery_of, fix_of, odometry_of, stamp_of

__all__ = ["Beginning"]

_STATIC = "/tf_static"
_LENGTH = 10 * NANOSECONDS
"""Part of a bag that is looked at: cameras and receivers have said all by then."""
_ONE_CLOCK = 60 * NANOSECONDS
"""Most that a header's stamp and the time of recording differ if they are by the same clock."""
_DRIFT = 86_400 * NANOSECONDS
"""Most that a simulation's clock runs away from that of the recording: slower or faster."""
_SLOWEST, _FASTEST = 0.1, 1000.0
"""Hertz of a camera."""


class Beginning:
    """What the first seconds of a bag tell of all of it."""

    def __init__(self, bag: RosBag, topics: BagTopics) -> None:
        """Read the beginning of `bag`; raises RecordingError for odometry that is not in ENU."""
        self.topics = topics
        self._offset: int | None = None
        """Nanoseconds to add to headers' stamps; None before one was set."""
        self._odometry: Odometry | None = None
        self.fix: GpsFix | None = None
        """The first fix."""
        self.battery = Battery(math.nan)
        """The first charge; NaN without one."""
        self._body = ""
        self._frames: dict[str, str] = {}
        self._sizes: dict[str, tuple[int, int]] = {}
        self._stamps: dict[str, list[int]] = defaultdict(list)
        self._infos: dict[str, Any] = {}
        self._places: dict[str, Place] = {}
        known = bag.topics
        wanted = {one.topic for one in topics.taken()}
        types = {name: known[name].schema for name in wanted}
        further = {info_topic(topic): typestore.CAMERA_INFO for topic in topics.camera.values()}
        further[_STATIC] = typestore.TRANSFORMS
        types |= {
            name: kind
            for name, kind in further.items()
            if name in known and known[name].schema == kind
        }
        end = None
        for message in bag.messages(types.keys()):
            end = end or message.time + _LENGTH
            if message.time > end:
                break
            # What is no place, size or fix tells nothing here; the import counts it.
            with suppress(ValueError):
                self._look(message, types[message.topic])
        stamps = [one for topic in wanted for one in self._stamps[topic]]
        self.epoch_ns = min(stamps, default=0)
        """Time of the earliest message taken, nanoseconds since 1970."""

    @property
    def home(self) -> GeodeticOrigin | None:
        """Origin of the local frame: where a fix and the odometry of its time agree."""
        if self.fix is None:
            return None
        origin = GeodeticOrigin(self.fix.latitude, self.fix.longitude, self.fix.altitude)
        if self._odometry is None:
            return origin
        return GeodeticOrigin(*origin.to_geodetic(-self._odometry.position))

    def times(self, message: BagMessage) -> tuple[int, int]:
        """When a message was measured and when it was recorded, nanoseconds since 1970.

        It was measured at its header's stamp; where none is set, when it was recorded. A clock of
        the headers that counts from elsewhere, as a simulation's does, is set by the first message,
        and both times are by it.

        Raises:
            ValueError: If the two are too far apart to be believed.
        """
        stamp = stamp_of(message.value) or message.time - message.shift
        if self._offset is None:
            apart = message.time - message.shift - stamp
            self._offset = message.time - stamp if abs(apart) > _ONE_CLOCK else 0
        # By one clock with the recording, the stamp leaps as that does.
        captured = stamp + (self._offset or message.shift)
        if abs(captured - message.time) > (_DRIFT if self._offset else _ONE_CLOCK):
            raise ValueError("its stamp is too far from the time of its recording")
        # Clocks of two machines may differ by a little; nothing is recorded before it was.
        return captured, captured if self._offset else max(captured, message.time)

    def camera(self, topic: str) -> dict[str, Any]:
        """Settings of a camera as far as they are known, as `lens.camera_settings` has them."""
        return camera_settings(
            self._sizes.get(topic),
            self._infos.get(info_topic(topic)),
            self._frames.get(topic, ""),
            self._body,
            self._places,
        )

    def rate(self, topic: str) -> float | None:
        """Items per second of a topic; None where fewer than two were seen."""
        gaps = np.diff(self._stamps[topic])
        median = float(np.median(gaps)) if gaps.size else 0.0
        if median <= 0:
            return None
        return round(min(max(NANOSECONDS / median, _SLOWEST), _FASTEST), 2)

    def camera_of_frame(self, frame: str) -> str | None:
        """Topic of the camera whose pictures are in `frame`, or of the only one; None: unknown."""
        found = [topic for topic, one in self._frames.items() if one == frame]
        topics = found or list(self.topics.camera.values())
        return topics[0] if len(topics) == 1 else None

    def _look(self, message: BagMessage, kind: str) -> None:
        value, topic = message.value, message.topic
        if kind == typestore.TRANSFORMS:
            for transform in value.transforms:
                self._places[transform.child_frame_id] = place_of(transform)
            return
        if kind == typestore.CAMERA_INFO:
            self._infos.setdefault(topic, value)
            return
        self._stamps[topic].append(self.times(message)[0])
        if kind == typestore.ODOMETRY and self._odometry is None:
            self._odometry, self._body = odometry_of(value), value.child_frame_id
        elif kind == typestore.NAV_SAT_FIX and self.fix is None:
            self.fix = fix_of(value)
        elif kind == typestore.BATTERY and math.isnan(self.battery.fraction):
            self.battery = battery_of(value)
        elif kind in {typestore.IMAGE, typestore.COMPRESSED_IMAGE} and topic not in self._sizes:
            self._frames[topic] = value.header.frame_id
            size = (
                (value.width, value.height)
                if kind == typestore.IMAGE
                else picture_size(picture_bytes(value))
            )
            if size is not None and picture_fits(*size):
                self._sizes[topic] = size
