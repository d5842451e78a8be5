"""Decoding of recorded images: Foxglove's and ROS 2's, compressed or raw, to BGR.

Also decodes the depth images that this project records (raw, 16UC1).
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.picture_size import picture_fits, picture_size
from aerodaas.errors import SourceError

__all__ = [
    "IMAGE_SCHEMAS",
    "VIDEO_SCHEMAS",
    "check_picture",
    "decode_depth",
    "decode_image",
    "picture_bytes",
    "picture_field",
]

_COMPRESSED = frozenset({"foxglove.CompressedImage", "sensor_msgs/msg/CompressedImage"})
_RAW = frozenset({"foxglove.RawImage", "sensor_msgs/msg/Image"})
IMAGE_SCHEMAS = _COMPRESSED | _RAW
"""Schemas of the messages that `decode_image` decodes."""
VIDEO_SCHEMAS = frozenset({"foxglove.CompressedVideo", "foxglove_msgs/msg/CompressedVideo"})
"""Schemas of video messages, which are decoded together with the preceding ones."""


class _Layout(NamedTuple):
    """Memory layout of a raw image's pixels."""

    channels: int
    kind: str
    """numpy type code of one channel."""
    conversion: int | None
    """OpenCV's conversion code to BGR; None for BGR itself."""


_LAYOUTS = {
    "bgr8": _Layout(3, "u1", None),
    "8UC3": _Layout(3, "u1", None),
    "rgb8": _Layout(3, "u1", cv2.COLOR_RGB2BGR),
    "bgra8": _Layout(4, "u1", cv2.COLOR_BGRA2BGR),
    "rgba8": _Layout(4, "u1", cv2.COLOR_RGBA2BGR),
    "mono8": _Layout(1, "u1", cv2.COLOR_GRAY2BGR),
    "8UC1": _Layout(1, "u1", cv2.COLOR_GRAY2BGR),
    "mono16": _Layout(1, "u2", cv2.COLOR_GRAY2BGR),
    "16UC1": _Layout(1, "u2", cv2.COLOR_GRAY2BGR),
    "yuv422": _Layout(2, "u1", cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": _Layout(2, "u1", cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": _Layout(2, "u1", cv2.COLOR_YUV2BGR_YUYV),
    "yuyv": _Layout(2, "u1", cv2.COLOR_YUV2BGR_YUYV),
    # OpenCV names Bayer patterns by the second row's second and third pixel.
    "bayer_rggb8": _Layout(1, "u1", cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": _Layout(1, "u1", cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": _Layout(1, "u1", cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": _Layout(1, "u1", cv2.COLOR_BayerGB2BGR),
}


def decode_image(schema: str, value: Any) -> NDArray[np.uint8] | None:  # noqa: ANN401 - by schema
    """Decode a message with an image.

    Args:
        schema: Name of its schema, one of `IMAGE_SCHEMAS`.
        value: The message: JSON, protobuf or ROS 2.

    Returns:
        Height x width x 3 of BGR, or None for an image that is broken or larger than `MAX_PIXELS`.

    Raises:
        SourceError: For an unknown pixel format.
    """
    encoded = picture_bytes(value)
    data = np.frombuffer(encoded, np.uint8)
    try:
        if schema not in _COMPRESSED:
            return _decode_raw(value, data)
        size = picture_size(encoded)
        if size is None or not picture_fits(*size):
            return None
        image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, np.uint8)


def decode_depth(value: Any) -> NDArray[np.uint16] | None:  # noqa: ANN401 - by schema
    """Decode a raw message in 16UC1 to height x width of millimetres; None for a broken one."""
    if picture_field(value, "encoding") != "16UC1":
        return None
    pixels = _pixels(value, np.frombuffer(picture_bytes(value), np.uint8), _LAYOUTS["16UC1"])
    return None if pixels is None else pixels[..., 0].astype(np.uint16)


def check_picture(value: Any, *, video: bool) -> None:  # noqa: ANN401 - by schema
    """Require that a message has the fields of a picture.

    Args:
        value: The message: JSON, protobuf or ROS 2.
        video: Whether it is a frame of a video, which has no `encoding`.

    Raises:
        TypeError: For a field of another type.
        ValueError: For a field of another value.
    """
    data = picture_field(value, "data")
    if isinstance(data, str):
        base64.b64decode(data, validate=True)
    elif isinstance(data, int | float) or not isinstance(data, Iterable):
        raise TypeError(f"its data are no bytes but {type(data).__name__}")
    else:
        memoryview(bytes(data))
    text = ("format",) if video else ("format", "encoding")
    for name in text:
        if not isinstance(picture_field(value, name, ""), str):
            raise TypeError(f"its {name} is no text")
    for name in ("width", "height", "step", "is_bigendian"):
        number = picture_field(value, name, 0)
        if not isinstance(number, int) or number < 0:
            raise ValueError(f"its {name} is no natural number")


def _decode_raw(value: Any, data: NDArray[np.uint8]) -> NDArray[np.uint8] | None:  # noqa: ANN401
    encoding = str(picture_field(value, "encoding"))
    layout = _LAYOUTS.get(encoding)
    if layout is None:
        known = ", ".join(_LAYOUTS)
        raise SourceError(
            f"pictures in {encoding!r} cannot be decoded; record them in one of: {known}"
        )
    pixels = _pixels(value, data, layout)
    if pixels is None:
        return None
    if layout.kind == "u2":
        pixels = (pixels >> 8).astype(np.uint8)
    if layout.conversion is None:
        return np.asarray(pixels, np.uint8)
    return np.asarray(cv2.cvtColor(pixels, layout.conversion), np.uint8)


def _pixels(
    value: Any,  # noqa: ANN401 - by schema
    data: NDArray[np.uint8],
    layout: _Layout,
) -> NDArray[Any] | None:
    """Pixels as stored, height x width x channels; None if bytes are missing."""
    width, height = (int(picture_field(value, side, 0)) for side in ("width", "height"))
    pixel = layout.channels * np.dtype(layout.kind).itemsize
    step = int(picture_field(value, "step", 0)) or width * pixel
    if not picture_fits(width, height) or step < width * pixel or data.size < step * height:
        return None
    rows = data[: step * height].reshape(height, step)[:, : width * pixel]
    order = ">" if picture_field(value, "is_bigendian", default=0) else "<"
    pixels = np.ascontiguousarray(rows).view(f"{order}{layout.kind}")
    return pixels.reshape(height, width, layout.channels)


def picture_bytes(value: Any) -> bytes:  # noqa: ANN401
    """The encoded image in a message."""
    data = picture_field(value, "data")
    # JSON carries bytes as Base64.
    return base64.b64decode(data) if isinstance(data, str) else bytes(data)


def picture_field(value: Any, name: str, default: Any = None) -> Any:  # noqa: ANN401
    """A field of a message.

    Args:
        value: The message: JSON, protobuf or ROS 2.
        name: Name of the field.
        default: Value where it is missing.
    """
    if isinstance(value, dict):
        return value.get(name, default)
    return getattr(value, name, default)
