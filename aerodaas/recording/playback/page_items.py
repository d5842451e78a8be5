"""A picture, its depth and its target as a page takes them, live as recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.wire_items import pack
from aerodaas.recording.playback.depth_picture import depth_picture
from aerodaas.types.data import Header
from aerodaas.types.target import FollowedTarget

__all__ = ["packed_depth", "packed_picture", "packed_target"]


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
        "header": pack(header)[0],
        "format": form,
        "depth": measured,
        "bytes": [size],
    }


def packed_depth(header: Header, depth: NDArray[np.uint16]) -> tuple[dict[str, Any], bytes]:
    """A frame's depth (height x width, millimetres) as a grey PNG, with its range in metres."""
    data, reach = depth_picture(depth)
    content = {"is": "Depth", "header": pack(header)[0], "range": reach, "bytes": [len(data)]}
    return content, data


def packed_target(header: Header, target: FollowedTarget) -> dict[str, Any]:
    """What a page is told of what is followed in the frame of `header`."""
    return {
        "is": "Target",
        "header": pack(header)[0],
        "state": target.state.value,
        "box": None if target.box is None else list(target.box),
    }
