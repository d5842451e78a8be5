"""Items over the wire, between a provider and its users: JSON, and a picture's bytes beside it.

What arrives is another's data: it is of known classes, each field is checked, and a picture has
the bounds of recorded ones before it is decoded. Nothing is a pickle.
"""

from __future__ import annotations

import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.item_json import decoded, encoded
from aerodaas.cameras.picture_size import picture_fits, picture_format, picture_size
from aerodaas.errors import AeroDaaSError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.opaque_item import OpaqueItem
from aerodaas.messages.schema import MessageError, json_of, message_of

__all__ = ["pack", "unpack"]

_FRAME = "Frame"
_FRAME_KEYS = {"is", "header", "camera", "odometry", "size", "format", "bytes"}
_QUALITY = 90
_FORMATS = ("jpeg", "png")
_DEPTH_FORMAT = (16, 0)
"""PNG's bit depth and colour type of a depth image: one channel of 16 bits."""


def pack(item: object, *, lossless: bool = False) -> tuple[Any, bytes]:
    """Write an item for the wire.

    Args:
        item: Of a class of `aerodaas.messages`, navigation that is no stream, a plain value, a
            list, tuple or dictionary of these; or None.
        lossless: Write a frame as PNG, not as JPEG of quality 90.

    Returns:
        The item as JSON, and its blob: a frame's picture, and after it its depth as a PNG of 16
        bits; empty for anything else.

    Raises:
        MessageError: For an item of another class, and for a picture that cannot be written.
    """
    if not isinstance(item, Frame):
        return encoded(item, _refused), b""
    words = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
    if lossless:
        words = [cv2.IMWRITE_PNG_COMPRESSION, 1]
    picture = _written(".png" if lossless else ".jpg", item.image, words)
    depth = b""
    if item.depth is not None:
        depth = _written(".png", item.depth, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    content = {
        "is": _FRAME,
        "header": json_of(item.header),
        "camera": None if item.camera is None else json_of(item.camera),
        "odometry": None if item.odometry is None else json_of(item.odometry),
        "size": [item.width, item.height],
        "format": "png" if lossless else "jpeg",
        "bytes": [len(picture), len(depth)],
    }
    return content, picture + depth


def unpack(content: Any, blob: bytes = b"") -> Any:  # noqa: ANN401 - JSON to any item
    """Rebuild an item from the wire; raises MessageError if it is malformed or too large."""
    if not (isinstance(content, dict) and content.get("is") == _FRAME):
        if blob:
            raise MessageError(f"an item with {len(blob)} bytes beside it is no frame")
        return decoded(content)
    try:
        return _frame(content, blob)
    except MessageError:
        raise
    except (AeroDaaSError, cv2.error, KeyError, TypeError, ValueError) as error:
        raise MessageError(f"malformed frame: {type(error).__name__}: {error}"[:300]) from None


def _refused(item: object) -> OpaqueItem:
    raise MessageError(
        f"{type(item).__name__} is of no class that goes over the wire, or holds one"
    )


def _written(suffix: str, image: NDArray[Any], words: list[int]) -> bytes:
    try:
        written, data = cv2.imencode(suffix, image, words)
    except cv2.error as error:
        raise MessageError(f"the picture cannot be written: {error}"[:300]) from None
    if not written:
        raise MessageError("the picture cannot be written")
    return bytes(data)


def _frame(content: dict[str, Any], blob: bytes) -> Frame:
    if content.keys() != _FRAME_KEYS:
        raise MessageError("a frame with other parts than a frame's")
    header = message_of(Header, content["header"])
    camera = None if content["camera"] is None else message_of(CameraModel, content["camera"])
    odometry = None if content["odometry"] is None else message_of(Odometry, content["odometry"])
    (width, height), (first, second) = content["size"], content["bytes"]
    numbers = (width, height, first, second)
    if not all(type(one) is int and one >= 0 for one in numbers) or first + second != len(blob):
        raise MessageError("a frame whose bytes are not those that it tells of")
    picture, rest = blob[:first], blob[first:]
    image = _decoded(picture, str(content["format"]), (width, height), cv2.IMREAD_COLOR)
    depth = _depth(rest, (width, height)) if rest else None
    return Frame(header, np.asarray(image, np.uint8), camera, odometry, depth)


def _depth(data: bytes, size: tuple[int, int]) -> NDArray[np.uint16]:
    bits = struct.unpack_from("BB", data, 24) if len(data) > 25 else None  # noqa: PLR2004 - IHDR
    if bits != _DEPTH_FORMAT:
        raise MessageError("a frame's depth is no PNG of one channel of 16 bits")
    return np.asarray(_decoded(data, "png", size, cv2.IMREAD_UNCHANGED), np.uint16)


def _decoded(data: bytes, kind: str, size: tuple[int, int], how: int) -> NDArray[Any]:
    if kind not in _FORMATS or picture_format(data) != kind:
        raise MessageError(f"a picture that is no {' or '.join(_FORMATS)}")
    if picture_size(data) != size or not picture_fits(*size):
        raise MessageError("a picture that is too large, or not of the size that it tells of")
    # Without the orientation that a JPEG may name, which would turn the picture.
    image = cv2.imdecode(np.frombuffer(data, np.uint8), how | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None or image.shape[1::-1] != size:
        raise MessageError("a damaged picture")
    return image
