"""Pictures and detections of a recording, as the types that streams carry."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from typing import Any

import cv2
import numpy as np

from aerodaas.data import Detection, Detections, Frame, Header, Odometry
from aerodaas.recording.reader import Record, Recording

__all__ = ["detections", "detections_by_frame", "frames"]


def frames(
    recording: Recording,
    topics: Collection[str] | None = None,
    stamps: Collection[int] | None = None,
) -> Iterator[Frame]:
    """Every picture in the order of recording, decoded; a broken one is left out.

    With `stamps`, only pictures captured at these mission times, and no other is decoded.

    A recording of others has no frame numbers: the message's sequence and frame id serve.
    """
    heads: dict[str, Record] = {}
    schemas = ("aerodaas.Frame", "foxglove.CompressedImage")
    for record in recording.records(schemas=schemas, topics=topics):
        if record.schema == "aerodaas.Frame":
            heads[record.topic] = record
            continue
        if stamps is not None and record.captured not in stamps:
            continue
        data = np.frombuffer(record.value.data, np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
        if image is None:
            continue
        head = heads.get(record.topic.removesuffix("/image")) or heads.get(
            record.topic.removesuffix("/image") + "/frame"
        )
        picture = np.asarray(image, dtype=np.uint8)
        if head is None or head.captured != record.captured:
            header = Header(record.sequence, record.captured, record.value.frame_id)
            yield Frame(header, picture)
        else:
            value = head.value
            header = Header(value["id"], value["stamp"], value["source"])
            yield Frame(header, picture, odometry=_odometry(value.get("odometry")))


def detections(recording: Recording) -> Iterator[tuple[str, Detections]]:
    """Topic and detections, in the order of recording."""
    for record in recording.records(schemas=("aerodaas.Detections",)):
        value = record.value
        header = Header(value["id"], value["stamp"], value["source"])
        items = tuple(_detection(item) for item in value["items"])
        yield record.topic, Detections(header, items, value["width"], value["height"])


def detections_by_frame(recording: Recording) -> dict[tuple[str, int], list[Detection]]:
    """What was found in each frame, by the frame's camera and stamp.

    A tracker repeats what its detector found, and adds to it: the later word counts.
    """
    found: dict[tuple[str, int], dict[tuple[str, object], Detection]] = defaultdict(dict)
    for _, result in detections(recording):
        at = found[result.header.source, result.header.stamp]
        at.update({(item.label, item.box): item for item in result})
    return {key: list(items.values()) for key, items in found.items()}


def _odometry(value: dict[str, Any] | None) -> Odometry | None:
    if value is None:
        return None
    position, velocity = (
        np.array([value[name][axis] for axis in "xyz"], dtype=np.float64)
        for name in ("position", "velocity")
    )
    return Odometry(
        position,
        velocity,
        value["yaw"],
        value["roll"],
        value["pitch"],
        value["yaw_rate"],
        value["position_sigma"],
    )


def _detection(value: dict[str, Any]) -> Detection:
    left, top, right, bottom = value["box"]
    points = value.get("keypoints")
    return Detection(
        (left, top, right, bottom),
        value["label"],
        value["score"],
        value.get("track_id"),
        None if points is None else np.array(points, dtype=np.float32),
    )
