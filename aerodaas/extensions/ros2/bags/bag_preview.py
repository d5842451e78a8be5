"""What is taken of a ROS 2 bag, and how it begins: its clock, its cameras' lenses, its home."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.images import picture_bytes
from aerodaas.cameras.picture_size import picture_fits, picture_size
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import RecordingError
from aerodaas.extensions.ros2.bags.bag import BagMessage, RosBag
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.incoming import (
    battery_of,
    euler_of,
    fix_of,
    odometry_of,
    stamp_of,
)
from aerodaas.geometry.frames import FLU_FROM_OPTICAL, GeodeticOrigin, rotation_from_rpy
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.recording.reader import Topic

__all__ = ["BagPreview", "BagTopics", "Taken", "use_of"]

_TYPES = {
    "camera": (types.COMPRESSED_IMAGE, types.IMAGE),
    "odometry": (types.ODOMETRY,),
    "gps": (types.NAV_SAT_FIX,),
    "battery": (types.BATTERY,),
}
"""Types that a topic may have, by its use."""
_SINGLE = ("odometry", "gps", "battery")
_LONGEST_CHAIN = 32
_LEVEL = math.radians(2.0)
"""Roll of a camera below which it is level, as ours all are."""
_NARROWEST, _WIDEST = 1.0, 179.0
"""Degrees of a field of view, exclusive."""
_STATIC = "/tf_static"
_LENGTH = 10 * NANOSECONDS
"""Part of a bag that is looked at: cameras and receivers have said all by then."""
_ONE_CLOCK = 60 * NANOSECONDS
"""Most that a header's stamp and the time of recording differ if they are by the same clock."""
_DRIFT = 86_400 * NANOSECONDS
"""Most that a simulation's clock runs away from that of the recording: slower or faster."""
_SLOWEST, _FASTEST = 0.1, 1000.0
"""Hertz of a camera."""


class Taken(NamedTuple):
    """A topic that is taken."""

    use: str
    """An option of `aerodaas import`."""
    name: str
    """Id of the sensor."""
    topic: str


@dataclass(frozen=True, slots=True)
class BagTopics:
    """Topics that are taken, by their use."""

    robot: str = "drone"
    """Id that the recording gives the vehicle."""
    camera: Mapping[str, str] = field(default_factory=dict)
    """Topics of pictures by the cameras' ids."""
    odometry: str | None = None
    gps: str | None = None
    battery: str | None = None

    def taken(self) -> list[Taken]:
        """All topics."""
        single = ((use, getattr(self, use)) for use in _SINGLE)
        cameras = [Taken("camera", *one) for one in self.camera.items()]
        return [*cameras, *(Taken(use, use, topic) for use, topic in single if topic is not None)]

    def check(self, known: Mapping[str, Topic]) -> None:
        """Compare with the topics of a bag.

        Raises:
            RecordingError: If nothing can be made of them: neither a camera nor odometry, a topic
                that is not there, of another type or taken twice, two streams of one name.
        """
        taken = self.taken()
        if not self.camera and not self.odometry:
            raise RecordingError("take at least a camera or odometry from the bag")
        for use, _, topic in taken:
            fitting = [name for name, one in known.items() if one.schema in _TYPES[use]]
            if topic not in fitting:
                found = f"is {known[topic].schema}" if topic in known else "is not there"
                raise RecordingError(
                    f"{topic} {found}; {use} takes {' or '.join(_TYPES[use])}, and the bag has: "
                    f"{', '.join(sorted(fitting)) or 'none'}"
                )
        for index, what in ((1, "stream"), (2, "topic")):
            name, count = Counter(one[index] for one in taken).most_common(1)[0]
            if count > 1:
                raise RecordingError(f"the {what} {name!r} is named {count} times; name others")


def use_of(schema: str) -> str:
    """Option of `aerodaas import` that fits topics of this type; empty if none does."""
    return next((use for use, fitting in _TYPES.items() if schema in fitting), "")


class Place(NamedTuple):
    """Pose of a frame in its parent."""

    parent: str
    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]
    """(3, 3), from the frame to its parent."""


def info_topic(image: str) -> str:
    """Topic of the `camera_info` beside an image, by ROS' convention.

    >>> info_topic("/front/image_raw/compressed")
    '/front/camera_info'
    """
    return image.removesuffix("/compressed").rpartition("/")[0] + "/camera_info"


def place_of(transform: Any) -> Place:  # noqa: ANN401 - a type made at run time
    """Pose in a `geometry_msgs/TransformStamped`; raises ValueError if it is none."""
    moved = transform.transform.translation
    translation = np.array([moved.x, moved.y, moved.z])
    if not np.isfinite(translation).all():
        raise ValueError(f"a transform by {translation}")
    turned = rotation_from_rpy(*euler_of(transform.transform.rotation))
    return Place(transform.header.frame_id, translation, turned)


def camera_settings(
    size: tuple[int, int] | None,
    info: Any,  # noqa: ANN401 - a type made at run time
    frame: str,
    body: str,
    places: Mapping[str, Place],
) -> dict[str, Any]:
    """Settings of a camera as an environment file has them, as far as the bag tells.

    Args:
        size: Width and height of its pictures in pixels; None where unknown.
        info: Its `sensor_msgs/CameraInfo`; None without one.
        frame: Frame of its pictures, which is optical by REP 103.
        body: Frame of the vehicle's body, FLU.
        places: Poses of frames by name.

    Returns:
        `width` and `height`; `horizontal_fov` in degrees, with `info`; `mount` in metres, `pitch`
        and `yaw` in degrees, where transforms lead from the camera to the body and it is level.
    """
    settings: dict[str, Any] = {}
    if size is not None:
        settings["width"], settings["height"] = size
    if info is not None and info.k[0] > 0 and info.width > 0:
        angle = math.degrees(2 * math.atan(info.width / 2 / info.k[0]))
        if _NARROWEST < angle < _WIDEST:
            settings["horizontal_fov"] = round(angle, 4)
    pose = _in_body(frame, body, places)
    if pose is not None:
        settings |= _mount(*pose)
    return settings


def _in_body(
    frame: str, body: str, places: Mapping[str, Place]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Translation and rotation of `frame` in `body`; None if no transforms lead there."""
    translation, rotation = np.zeros(3), np.eye(3)
    for _ in range(_LONGEST_CHAIN):
        if frame == body:
            return translation, rotation
        place = places.get(frame)
        if place is None:
            return None
        translation = place.translation + place.rotation @ translation
        rotation = place.rotation @ rotation
        frame = place.parent
    return None


def _mount(translation: NDArray[np.float64], rotation: NDArray[np.float64]) -> dict[str, Any]:
    # The camera's own FLU axes in the body's; z-y-x angles as `rotation_from_rpy` has them.
    turned = rotation @ FLU_FROM_OPTICAL.T
    roll = math.atan2(turned[2, 1], turned[2, 2])
    if abs(roll) > _LEVEL:
        return {}
    pitch = -math.asin(max(-1.0, min(1.0, turned[2, 0])))
    yaw = math.atan2(turned[1, 0], turned[0, 0])
    return {
        "mount": [round(float(axis), 4) for axis in translation],
        "pitch": round(math.degrees(pitch), 4),
        "yaw": round(math.degrees(yaw), 4),
    }


class BagPreview:
    """Preview of a bag from its first seconds."""

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
        schemas = {name: known[name].schema for name in wanted}
        further = {info_topic(topic): types.CAMERA_INFO for topic in topics.camera.values()}
        further[_STATIC] = types.TRANSFORMS
        schemas |= {
            name: kind
            for name, kind in further.items()
            if name in known and known[name].schema == kind
        }
        end = None
        for message in bag.messages(schemas.keys()):
            end = end or message.time + _LENGTH
            if message.time > end:
                break
            # What is no place, size or fix tells nothing here; the import counts it.
            with suppress(ValueError):
                self._inspect(message, schemas[message.topic])
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
        stamp = stamp_of(message.value) or message.time
        if self._offset is None:
            apart = message.time - stamp
            self._offset = apart if abs(apart) > _ONE_CLOCK else 0
        captured = stamp + self._offset
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

    def _inspect(self, message: BagMessage, kind: str) -> None:
        value, topic = message.value, message.topic
        if kind == types.TRANSFORMS:
            for transform in value.transforms:
                self._places[transform.child_frame_id] = place_of(transform)
            return
        if kind == types.CAMERA_INFO:
            self._infos.setdefault(topic, value)
            return
        self._stamps[topic].append(self.times(message)[0])
        if kind == types.ODOMETRY and self._odometry is None:
            self._odometry, self._body = odometry_of(value), value.child_frame_id
        elif kind == types.NAV_SAT_FIX and self.fix is None:
            self.fix = fix_of(value)
        elif kind == types.BATTERY and math.isnan(self.battery.fraction):
            self.battery = battery_of(value)
        elif kind in {types.IMAGE, types.COMPRESSED_IMAGE} and topic not in self._sizes:
            self._frames[topic] = value.header.frame_id
            size = (
                (value.width, value.height)
                if kind == types.IMAGE
                else picture_size(picture_bytes(value))
            )
            if size is not None and picture_fits(*size):
                self._sizes[topic] = size
