"""What a page takes of a picture, live as recorded: itself, its depth, finds and target."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.following.ground_point import ground_point
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.schema import json_of
from aerodaas.messages.waypoints import FollowedTarget
from aerodaas.recording.playback.depth_picture import depth_picture
from aerodaas.terrain.ground import Ground

__all__ = ["packed_depth", "packed_picture", "packed_places", "packed_target"]

_MOST_PLACES = 64
"""Most places of one frame's detections, the surest first: a map has no room for more."""


def packed_picture(header: Header, size: int, form: str, *, measured: bool) -> dict[str, Any]:
    """What a page is told of a picture.

    Args:
        header: Of its frame.
        size: Bytes of the picture.
        form: `jpeg` or `h264`.
        measured: Whether the camera measured depth with it.
    """
    return {
        "is": "Picture",
        "header": json_of(header),
        "format": form,
        "depth": measured,
        "bytes": [size],
    }


def packed_depth(header: Header, depth: NDArray[np.uint16]) -> tuple[dict[str, Any], bytes]:
    """A frame's depth (height x width, millimetres) as a grey PNG, with its range in metres."""
    data, reach = depth_picture(depth)
    content = {"is": "Depth", "header": json_of(header), "range": reach, "bytes": [len(data)]}
    return content, data


def packed_target(header: Header, target: FollowedTarget) -> dict[str, Any]:
    """What a page is told of what is followed in the frame of `header`."""
    return {
        "is": "Target",
        "header": json_of(header),
        "state": target.state.value,
        "box": None if target.box is None else list(target.box),
    }


def packed_places(found: Detections, ground: Ground | None = None) -> dict[str, Any]:
    """What a page is told of where on the ground each detection stands, beside the detections.

    Args:
        found: The detections, best first, with the camera and the odometry of their frame.
        ground: The terrain; None for the plane of the local frame's zero.

    Returns:
        `places`: for each detection metres east, north and up, and its ellipse's standard
        deviations in metres and direction in radians; null where that is not known.
    """
    return {"places": [_place(one, found, ground) for one in found[:_MOST_PLACES]]}


def _place(one: Detection, found: Detections, ground: Ground | None) -> list[float] | None:
    place = ground_point(one, found, ground)
    if place is None:
        return None
    numbers = (place.east, place.north, place.up, place.major, place.minor, place.angle)
    return [round(number, 3) for number in numbers]
