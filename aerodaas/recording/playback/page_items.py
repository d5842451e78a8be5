"""What a page takes of a picture, live as recorded: itself, its depth, finds and target."""

from __future__ import annotations

from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.following.ground_point import ground_point
from aerodaas.geometry.depth import METRE
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import FollowedTarget
from aerodaas.protocol.base import AnswerModel
from aerodaas.protocol.live import DepthItem, PictureItem, TargetItem
from aerodaas.terrain.ground import Ground

__all__ = ["depth_picture", "packed_depth", "packed_picture", "packed_places", "packed_target"]

_WIDEST = 320
"""Pixels across, at most; wider depth is thinned out, not blurred over edges."""
_SHADES = 254
"""Shades from nearest to farthest; a further one, 0, is for what was not measured."""
_FARTHEST = 99.0
"""Percentile of the measured that the range holds: single far pixels do not stretch it."""
_STEPS = (1.0, 2.0, 3.0, 5.0, 7.0)
"""Ranges, times powers of ten, so that the colours do not change with each picture."""
_MOST_PLACES = 64
"""Most places of one frame's detections, the surest first: a map has no room for more."""


def depth_picture(depth: NDArray[np.uint16]) -> tuple[bytes, float]:
    """Draw depth.

    Args:
        depth: Height x width of millimetres, 0 where not measured.

    Returns:
        A PNG of 8-bit grey, at most 320 pixels across: 0 where nothing was measured, else 1 at the
        camera to 255 at the range and beyond. And that range in metres: the least of 1, 2, 3, 5, 7,
        10, 20, ... that holds 99 % of what was measured; 1 where nothing was.
    """
    step = -(-depth.shape[1] // _WIDEST)
    metres = depth[::step, ::step].astype(np.float32) / METRE
    measured = metres > 0
    farthest = float(np.percentile(metres[measured], _FARTHEST)) if measured.any() else 0.0
    reach = _range(farthest)
    shades = 1 + np.rint(np.minimum(metres / reach, 1.0) * _SHADES)
    grey = np.where(measured, shades, 0).astype(np.uint8)
    return cv2.imencode(".png", grey, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes(), reach


def _range(farthest: float) -> float:
    """The least range that holds `farthest`; depth of 16 bits reaches 65.5 m."""
    ranges = [step * scale for scale in (1.0, 10.0) for step in _STEPS]
    return next(one for one in ranges if one >= farthest)


def packed_picture(
    header: Header, size: int, form: Literal["jpeg", "h264"], *, measured: bool
) -> dict[str, Any]:
    """Header of a picture for a page.

    Args:
        header: Of its frame.
        size: Bytes of the picture.
        form: How it is encoded.
        measured: Whether the camera measured depth with it.
    """
    item = PictureItem.model_construct(header=header, format=form, depth=measured, bytes=(size,))
    return _json(item)


def packed_depth(header: Header, depth: NDArray[np.uint16]) -> tuple[dict[str, Any], bytes]:
    """A frame's depth as a grey PNG, with its range in metres.

    Args:
        header: Header of the frame.
        depth: Depth picture, height x width, millimetres.

    Returns:
        JSON of the item, and the PNG.
    """
    data, reach = depth_picture(depth)
    item = DepthItem.model_construct(header=header, range=reach, bytes=(len(data),))
    return _json(item), data


def packed_target(header: Header, target: FollowedTarget) -> dict[str, Any]:
    """Followed target in a frame, for a page.

    Args:
        header: Header of the frame.
        target: The target.
    """
    item = TargetItem.model_construct(header=header, of=target)
    return _json(item)


def _json(item: AnswerModel) -> dict[str, Any]:
    return item.model_dump(mode="json", by_alias=True)


def packed_places(found: Detections, ground: Ground | None = None) -> dict[str, Any]:
    """Detections for a page, each with its place on the ground.

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
