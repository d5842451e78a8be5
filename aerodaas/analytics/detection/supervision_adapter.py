"""Detections to and from Roboflow's `supervision`, for its trackers, zones and annotators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from aerodaas.config.extras import require_extra
from aerodaas.errors import ConfigError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame

if TYPE_CHECKING:
    import supervision

__all__ = ["from_supervision", "to_supervision"]

_NAMES = "class_name"
"""Where supervision keeps labels in its `data`."""
_DEPTH = "depth"
_KEYPOINTS = "keypoints"
_UNTRACKED = -1
"""Stands for no identity where others have one, as with supervision's trackers."""


def to_supervision(
    detections: Detections, classes: Sequence[str] | None = None
) -> supervision.Detections:
    """Make `supervision.Detections` of ours.

    Args:
        detections: Detections in one frame.
        classes: Labels in the order of the numbers that they get; None for the labels that are
            there, sorted. Give them where numbers are to mean the same in every frame.

    Returns:
        Boxes in pixels, confidence, class and, where there are any, tracker ids; labels in
        `data["class_name"]`, depths in metres in `data["depth"]` (NaN where not measured), and
        keypoints in `data["keypoints"]` if all have as many.

    Raises:
        ConfigError: If a label is not among `classes`, or the extra `supervision` is missing.
    """
    require_extra("supervision", "to_supervision")
    import supervision  # noqa: PLC0415 - an extra

    items = detections.items
    labels = [item.label for item in items]
    order = sorted(set(labels)) if classes is None else list(classes)
    unknown = sorted(set(labels) - set(order))
    if unknown:
        raise ConfigError(f"to_supervision: {unknown[0]!r} is not among the classes {order}")
    tracks = [_UNTRACKED if item.track_id is None else item.track_id for item in items]
    data: dict[str, Any] = {_NAMES: np.array(labels, dtype=str)}
    if any(item.depth is not None for item in items):
        depths = [math.nan if item.depth is None else item.depth for item in items]
        data[_DEPTH] = np.array(depths)
    points = [item.keypoints for item in items if item.keypoints is not None]
    if items and len(points) == len(items) and len({one.shape for one in points}) == 1:
        data[_KEYPOINTS] = np.stack(points)
    return supervision.Detections(
        xyxy=np.array([item.box for item in items], dtype=np.float64).reshape(-1, 4),
        confidence=np.array([item.score for item in items], dtype=np.float64),
        class_id=np.array([order.index(label) for label in labels], dtype=np.int64),
        tracker_id=np.array(tracks, dtype=np.int64) if set(tracks) - {_UNTRACKED} else None,
        data=data,
    )


def from_supervision(
    found: supervision.Detections, seen: Frame | Detections, classes: Sequence[str] | None = None
) -> Detections:
    """Make our detections of `supervision.Detections`.

    Args:
        found: What supervision says of one frame.
        seen: That frame, or the detections that it was made from; the result has its header,
            camera and odometry.
        classes: Labels by class number, where `found` has no names.

    Returns:
        Detections, best first. Without confidence each has a score of 1. Depth comes from `found`,
        or is measured anew in a frame.

    Raises:
        ConfigError: If an object has no label.
    """
    names = found.data.get(_NAMES)
    depths, points = found.data.get(_DEPTH), found.data.get(_KEYPOINTS)
    items = []
    for index, box in enumerate(np.asarray(found.xyxy, dtype=np.float64).tolist()):
        left, top, right, bottom = box
        track = _UNTRACKED if found.tracker_id is None else int(found.tracker_id[index])
        depth = math.nan if depths is None else float(depths[index])
        items.append(
            Detection(
                (left, top, right, bottom),
                _label(found, index, names, classes),
                1.0 if found.confidence is None else float(found.confidence[index]),
                None if track == _UNTRACKED else track,
                None if points is None else np.asarray(points[index], dtype=np.float32),
                None if math.isnan(depth) else depth,
            )
        )
    if isinstance(seen, Frame):
        return Detections.of(seen, items)
    return replace(seen, items=tuple(sorted(items, key=lambda item: -item.score)))


def _label(
    found: supervision.Detections,
    index: int,
    names: Any,  # noqa: ANN401 - an array or a list
    classes: Sequence[str] | None,
) -> str:
    if names is not None:
        return str(names[index])
    number = -1 if found.class_id is None else int(found.class_id[index])
    if classes is None or not 0 <= number < len(classes):
        raise ConfigError(
            f"from_supervision: object {index} has no class name; give `classes`, one for each "
            "number"
        )
    return classes[number]
