"""Items over the wire, between a provider and its users: JSON, and a picture's bytes beside it.

A text, a truth value, a finite number or None is itself. Anything else is `{"is": CLASS, "of":
CONTENT}`; the content of a message is as `aerodaas.messages.serialization.schema` has it. What
arrives is another's data: it is of known classes, each field is checked, and a picture has the
bounds of recorded ones before it is decoded. Nothing is a pickle.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.picture_size import picture_fits, picture_format, picture_size
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import AeroDaaSError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.serialization.json_types import Int64
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.messages.serialization.records import fast_pickle
from aerodaas.messages.serialization.schema import MessageError, json_of, message_of
from aerodaas.messages.vehicle import VehicleState
from aerodaas.messages.waypoints import (
    NavigationItem,
    NavigationType,
    SchedulingType,
    VelocityCommand,
    Waypoint,
)

__all__ = ["WIRE_CLASSES", "UnknownClassError", "item_json", "pack", "unpack"]

WIRE_CLASSES: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        *(Alert, Battery, Detection, Detections, GpsFix, MissionStatus, Odometry, OpaqueItem),
        *(Readings, VehicleState, VelocityCommand, Waypoint),
    )
}
"""Classes of messages that may be sent as they are, by name."""
_SCALARS = frozenset({bool, int, float, str, type(None)})
_NOT_FINITE = ("nan", "inf", "-inf")
_QUALITY = 90
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]
_DEPTH_FORMAT = (16, 0)
"""PNG's bit depth and colour type of a depth image: one channel of 16 bits."""
_MOST_LEVELS = 24
_MOST_PARTS = 100_000
"""Most levels, and most parts on all of them, of one item's JSON."""


class UnknownClassError(MessageError):
    """An item is of no class that goes over the wire, or holds one."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class _Navigation:
    """Content of navigation."""

    items: tuple[NavigationItem, ...]
    type: NavigationType
    scheduling: SchedulingType
    priority: int | None


@fast_pickle
@dataclass(frozen=True, slots=True)
class _FrameHead:
    """Content of a frame, whose picture and depth are the blob."""

    header: Header
    camera: CameraModel | None
    odometry: Odometry | None
    picture: Int64
    """Bytes of the picture; the rest of the blob is the depth."""


def pack(item: object, *, lossless: bool = False) -> tuple[Any, bytes]:
    """Write an item for the wire.

    Args:
        item: A frame, or what `item_json` takes.
        lossless: Write a frame as PNG, not as JPEG of quality 90.

    Returns:
        The item as JSON, and its blob: a frame's picture, and after it its depth as a PNG of 16
        bits; empty for anything else.

    Raises:
        MessageError: As `item_json` does.
    """
    if isinstance(item, Frame):
        return _packed_frame(item, lossless=lossless)
    return item_json(item), b""


def item_json(item: object) -> Any:  # noqa: ANN401 - JSON
    """Write an item that is no frame as JSON.

    Args:
        item: A message of `WIRE_CLASSES`, navigation that is no stream, a text, a truth value, a
            number or None.

    Returns:
        A value of JSON's own types.

    Raises:
        UnknownClassError: For an item of another class.
        MessageError: For a field that cannot be written.
    """
    if isinstance(item, np.generic):
        item = item.item()
    name = type(item).__name__
    if type(item) is float and not math.isfinite(item):
        # JSON has no such numbers, and strict readers refuse what Python writes for them.
        return {"is": name, "of": repr(item)}
    if type(item) in _SCALARS:
        return item
    if WIRE_CLASSES.get(name) is type(item):
        return {"is": name, "of": json_of(item)}
    if isinstance(item, AeroNavigation) and item.stream is None:
        items = tuple(item)
        if {type(one) for one in items} <= {Waypoint, VelocityCommand}:
            content = _Navigation(items, item.navigation_type, item.scheduling_type, item.priority)
            return {"is": "AeroNavigation", "of": json_of(content)}
    raise UnknownClassError(f"{name} is of no class that goes over the wire, or holds one")


def unpack(content: Any, blob: bytes = b"") -> Any:  # noqa: ANN401 - JSON to any item
    """Rebuild an item from the wire.

    Args:
        content: JSON of the item; it may be a stranger's.
        blob: Bytes beside it, only for a frame.

    Raises:
        MessageError: If it is malformed or too large.
    """
    _require_bounds(content)
    whole = content if isinstance(content, dict) else {"is": type(content).__name__}
    kind = str(whole.get("is"))
    if blob and kind != "Frame":
        raise MessageError(f"an item with {len(blob)} bytes beside it is no frame")
    if type(content) in _SCALARS:
        return content
    try:
        return _unpacked(kind, whole.get("of"), blob)
    except MessageError:
        raise
    except (AeroDaaSError, cv2.error, TypeError, ValueError) as error:
        raise MessageError(f"malformed item: {type(error).__name__}: {error}"[:300]) from None


def _unpacked(kind: str, content: Any, blob: bytes) -> Any:  # noqa: ANN401 - JSON to any item
    if kind in WIRE_CLASSES:
        return message_of(WIRE_CLASSES[kind], content)
    if kind == "Frame":
        return _frame(message_of(_FrameHead, content), blob)
    if kind == "AeroNavigation":
        found = message_of(_Navigation, content)
        return AeroNavigation(found.type, found.items, found.scheduling, priority=found.priority)
    if kind == "float" and content in _NOT_FINITE:
        return float(content)
    raise MessageError(f"there is no class {kind[:40]!r} that goes over the wire")


def _require_bounds(content: object) -> None:
    """Raise MessageError for what takes long to read."""
    level, parts = [content], 1
    for _ in range(_MOST_LEVELS):
        inner = [part for part in level if isinstance(part, dict | list)]
        parts += sum(map(len, inner))
        if parts > _MOST_PARTS:
            break
        if not inner:
            return
        level = [part for one in inner for part in (one.values() if isinstance(one, dict) else one)]
    raise MessageError(f"more than {_MOST_LEVELS} levels or {_MOST_PARTS} parts in one item")


def _packed_frame(frame: Frame, *, lossless: bool) -> tuple[Any, bytes]:
    form, words = (".png", _PNG) if lossless else (".jpg", [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    picture = cv2.imencode(form, frame.image, words)[1].tobytes()
    depth = b"" if frame.depth is None else cv2.imencode(".png", frame.depth, _PNG)[1].tobytes()
    head = _FrameHead(frame.header, frame.camera, frame.odometry, len(picture))
    return {"is": "Frame", "of": json_of(head)}, picture + depth


def _frame(head: _FrameHead, blob: bytes) -> Frame:
    picture, rest = blob[: head.picture], blob[head.picture :]
    image = np.asarray(_decoded(picture, ("jpeg", "png"), cv2.IMREAD_COLOR), np.uint8)
    if not rest:
        return Frame(head.header, image, head.camera, head.odometry)
    bits = struct.unpack_from("BB", rest, 24) if len(rest) > 25 else None  # noqa: PLR2004 - IHDR
    if bits != _DEPTH_FORMAT or picture_size(rest) != picture_size(picture):
        raise MessageError("a frame's depth is no PNG of its size with one channel of 16 bits")
    depth = np.asarray(_decoded(rest, ("png",), cv2.IMREAD_UNCHANGED), np.uint16)
    return Frame(head.header, image, head.camera, head.odometry, depth)


def _decoded(data: bytes, forms: tuple[str, ...], how: int) -> NDArray[Any]:
    if picture_format(data) not in forms:
        raise MessageError(f"a picture that is no {' or '.join(forms)}")
    size = picture_size(data)
    if size is None or not picture_fits(*size):
        raise MessageError("a picture that is too large, or has no size")
    # Without the orientation that a JPEG may name, which would turn the picture.
    image = cv2.imdecode(np.frombuffer(data, np.uint8), how | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None or image.shape[1::-1] != size:
        raise MessageError("a damaged picture")
    return image
