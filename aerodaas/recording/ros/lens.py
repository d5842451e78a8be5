"""Lens and place of a camera in a ROS 2 bag, from its `camera_info` and the static transforms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import FLU_FROM_OPTICAL, rotation_from_rpy
from aerodaas.ros.incoming import euler_of

__all__ = ["Place", "camera_settings", "info_topic", "place_of"]

_LONGEST_CHAIN = 32
_LEVEL = math.radians(2.0)
"""Roll of a camera below which it is level, as ours all are."""
_NARROWEST, _WIDEST = 1.0, 179.0
"""Degrees of a field of view, exclusive."""


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
